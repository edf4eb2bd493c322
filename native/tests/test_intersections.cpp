// Counting and listing give, with every kernel and bit for bit, the result of testing every triangle, each triangle
// once.
#include <gtest/gtest.h>

#include <cstring>

#include "query/trace.h"
#include "tests/reference_trace.h"
#include "tests/scenes_to_trace.h"

namespace perfect_bvh::test {
namespace {

struct Listed {
  std::vector<std::int64_t> splits;
  std::vector<float> t, uvs;
  std::vector<std::int32_t> instances, primitives;
};

class Intersections : public KernelTest {
 protected:
  // Each ray has its own range and mask, so all columns have one row per ray.
  struct Columns {
    explicit Columns(const std::vector<Ray>& rays, Cull cull) {
      for (const Ray& ray : rays) {
        origins.push_back(ray.origin), directions.push_back(ray.direction);
        t_min.push_back(ray.t_min), t_max.push_back(ray.t_max), masks.push_back(ray.mask);
      }
      view.count = rays.size();
      view.origins_double = origins.data(), view.directions_double = directions.data();
      view.t_min = t_min.data(), view.t_max = t_max.data(), view.masks = masks.data();
      view.t_min_stride = view.t_max_stride = view.mask_stride = 1;
      view.cull = cull;
    }
    std::vector<Vec3d> origins, directions;
    std::vector<float> t_min, t_max;
    std::vector<std::uint32_t> masks;
    RayColumns view;
  };

  static Listed list(const Snapshot& snapshot, const RayColumns& rays, std::int64_t most) {
    ThreadPool pool(1);
    CancelToken cancel;
    std::vector<std::int32_t> counts(rays.count);
    count_intersections(snapshot, rays, counts.data(), pool, 0, cancel);
    Listed listed;
    listed.splits.push_back(0);
    for (const std::int32_t count : counts)
      listed.splits.push_back(listed.splits.back() + std::min<std::int64_t>(count, most));
    const auto rows = static_cast<std::size_t>(listed.splits.back());
    listed.t.resize(rows), listed.uvs.resize(2 * rows), listed.instances.resize(rows), listed.primitives.resize(rows);
    HitColumns out;
    out.t = listed.t.data(), out.uvs = listed.uvs.data();
    out.instance_ids = listed.instances.data(), out.primitive_ids = listed.primitives.data();
    list_intersections(snapshot, rays, listed.splits, out, pool, 0, cancel);
    return listed;
  }

  static void expect_reference(const Snapshot& snapshot, const std::vector<Ray>& rays, Cull cull = Cull::kNone) {
    const Columns columns(rays, cull);
    for (const std::int64_t most : {std::int64_t{1000000}, std::int64_t{2}}) {
      const Listed listed = list(snapshot, columns.view, most);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        std::vector<ReferenceHit> expected = reference_hits(snapshot, rays[i], cull);
        expected.resize(std::min(expected.size(), static_cast<std::size_t>(most)));
        ASSERT_EQ(static_cast<std::size_t>(listed.splits[i + 1] - listed.splits[i]), expected.size()) << "ray " << i;
        for (std::size_t k = 0; k < expected.size(); ++k) {
          const std::size_t row = static_cast<std::size_t>(listed.splits[i]) + k;
          const Hit& hit = expected[k].hit;
          ASSERT_EQ(std::memcmp(&listed.t[row], &hit.t, sizeof(float)), 0) << "ray " << i << " hit " << k;
          ASSERT_EQ(std::memcmp(&listed.uvs[2 * row], &hit.u, 2 * sizeof(float)), 0) << "ray " << i << " hit " << k;
          ASSERT_EQ(listed.instances[row], snapshot.instances[hit.instance_index].id);
          ASSERT_EQ(listed.primitives[row], static_cast<std::int32_t>(hit.primitive_index));
        }
      }
    }
  }
};

INSTANTIATE_TEST_SUITE_P(All, Intersections, testing::ValuesIn(kernel_names()), Intersections::name_of);

TEST_P(Intersections, MatchTheReferenceOnSingleMeshes) {
  expect_reference(*commit({{soup(300, 1), {Affine{}}}}), random_rays(600, 10));
  expect_reference(*commit({{slivers(300, 2), {Affine{}}}}), random_rays(600, 20));
  expect_reference(*commit({{coincident(20, 3), {Affine{}}}}), random_rays(600, 30));
  expect_reference(*commit({{wide_soup(300, 4), {Affine{}}}}), random_rays(600, 40));
}

TEST_P(Intersections, MatchTheReferenceOnRaysAtEdgesAndVertices) {
  const MeshData box = box_of_grids(6);
  const auto snapshot = commit({{box, {Affine{}}}});
  const std::vector<Ray> rays = aimed_rays(box, 1000, 1);
  expect_reference(*snapshot, rays);
}

// Down on a grid with representable vertices: a ray at an edge hits two triangles, a ray at a vertex up to six.
TEST_P(Intersections, CountEveryTriangleAtAnEdge) {
  const auto snapshot = commit({{box_of_grids(4), {Affine{}}}});
  std::vector<Ray> rays;
  for (int i = -7; i <= 7; ++i) {
    for (int j = -7; j <= 7; ++j) {
      Ray& ray = rays.emplace_back();
      ray.origin = {0.125 * i, 0.125 * j, 5}, ray.direction = {0, -0.0, -1};
    }
  }
  expect_reference(*snapshot, rays);
  const Columns columns(rays, Cull::kNone);
  const Listed listed = list(*snapshot, columns.view, 1000);
  const auto at = [&](std::size_t i, std::size_t j) {
    const std::size_t row = 15 * i + j;
    return listed.splits[row + 1] - listed.splits[row];
  };
  EXPECT_EQ(at(7, 7), 2 * 6);  // a vertex above and below
  EXPECT_EQ(at(8, 8), 2 * 2);  // a diagonal
  EXPECT_EQ(at(7, 8), 2 * 2);  // a side
  EXPECT_EQ(at(8, 9), 2 * 1);  // within
}

// A triangle that is split into many references is reported once.
TEST_P(Intersections, ReportEachTriangleOnceOfTreesWithSpatialSplits) {
  BuildConfig config;
  config.builder = BuilderKind::kSpatial;
  config.duplication_budget = 4.0f;
  config.traversal_cost = 0.01f;
  const auto snapshot = commit({{slivers(300, 1), {Affine{}}}}, 1.0f, config);
  EXPECT_TRUE(snapshot->view.repeats_triangles);
  expect_reference(*snapshot, random_rays(800, 2));
  expect_reference(*snapshot, aimed_rays(slivers(300, 1), 800, 3));
  expect_reference(*commit({{soup(60, 1), many_places(20, 2)}, {slivers(60, 3), many_places(20, 4)}}, 1.0f, config),
                   random_rays(400, 5));
}

TEST_P(Intersections, MatchTheReferenceThroughInstances) {
  const auto snapshot = commit({{soup(40, 1), many_places(30, 2)}, {box_of_grids(2), many_places(20, 3)}});
  for (const Cull cull : {Cull::kNone, Cull::kBack}) expect_reference(*snapshot, random_rays(400, 4), cull);
  expect_reference(*commit({{box_of_grids(2), std::vector<Affine>(12)}}), random_rays(300, 5));
}

TEST_P(Intersections, MatchTheReferenceAtExtremeScales) {
  for (const float scale : {1e-30f, 1e-7f, 1e16f}) {
    const auto snapshot = commit({{soup(60, 1), many_places(3, 2)}, {slivers(60, 3), {Affine{}}}}, scale);
    expect_reference(*snapshot, random_rays(300, 6, scale));
  }
}

// Far more hits than the initial memory can hold.
TEST_P(Intersections, ManyHitsOnOneRay) {
  MeshData layers;
  for (int i = 0; i < 20000; ++i) {
    const float z = static_cast<float>(i % 5000);
    layers.add({-1, -1, z}, {1, -1, z}, {0, 1, z});
  }
  Ray ray;
  ray.origin = {0, 0, -1}, ray.direction = {0, 0, 1};
  expect_reference(*commit({{layers, {Affine{}}}}), {ray, ray, Ray{}, ray});
}

TEST_P(Intersections, EmptyScenesAndBadRaysHaveNone) {
  Scene scene;
  ThreadPool pool(1);
  CancelToken cancel;
  scene.commit(pool, cancel);
  expect_reference(*scene.snapshot(), random_rays(5, 1));
  std::vector<Ray> rays(3);
  rays[1].direction = {0, 0, 1}, rays[1].t_min = 2, rays[1].t_max = 1;
  rays[2].direction = {0, std::numeric_limits<double>::quiet_NaN(), 1};
  expect_reference(*commit({{box_of_grids(2), {Affine{}}}}), rays);
}

}  // namespace
}  // namespace perfect_bvh::test
