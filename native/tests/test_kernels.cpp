// Every kernel gives, with any number of rays in flight and bit for bit, the result of testing every triangle: on
// soups, slivers, coincident and degenerate triangles, instances of every kind, extreme scales and directions.
#include <gtest/gtest.h>

#include <cfenv>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/errors.h"
#include "query/trace.h"
#include "tests/reference_trace.h"
#include "tests/scenes_to_trace.h"
#include "traverse/dispatch.h"

namespace perfect_bvh::test {
namespace {

constexpr TraceOptions kWays[] = {{Strategy::kAuto, 0},
                                  {Strategy::kPackets, 0},
                                  {Strategy::kStream, 0},
                                  {Strategy::kStream, 5},
                                  {Strategy::kSingle, 0}};

class Kernels : public KernelTest {
 protected:
  static void expect_reference(const Snapshot& snapshot, const std::vector<Ray>& rays, Cull cull = Cull::kNone) {
    std::vector<Hit> expected(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) expected[i] = reference_closest(snapshot, rays[i], cull);
    for (const TraceOptions& options : kWays) {
      std::vector<Hit> hits(rays.size());
      std::vector<std::uint8_t> occluded(rays.size());
      trace_closest(snapshot.view, {rays.data(), rays.size(), cull, nullptr, hits.data(), nullptr}, options);
      trace_any(snapshot.view, {rays.data(), rays.size(), cull, nullptr, nullptr, occluded.data()}, options);
      const auto how = "strategy " + std::to_string(static_cast<int>(options.strategy)) + ", " +
                       std::to_string(options.in_flight) + " in flight";
      for (std::size_t i = 0; i < rays.size(); ++i) {
        ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(Hit)), 0)
            << "ray " << i << ", " << how << ": " << hits[i].t << " instance " << hits[i].instance_index
            << " primitive " << hits[i].primitive_index << ", expected " << expected[i].t << " instance "
            << expected[i].instance_index << " primitive " << expected[i].primitive_index;
        ASSERT_EQ(occluded[i] != 0, expected[i].found()) << "ray " << i << ", " << how;
      }
    }
  }
};

INSTANTIATE_TEST_SUITE_P(All, Kernels, testing::ValuesIn(kernel_names()), Kernels::name_of);

TEST_P(Kernels, MatchTheReferenceOnSingleMeshes) {
  for (std::uint32_t seed = 0; seed < 3; ++seed) {
    expect_reference(*commit({{soup(300, seed), {Affine{}}}}), random_rays(800, seed + 10));
    expect_reference(*commit({{slivers(300, seed), {Affine{}}}}), random_rays(800, seed + 20));
    expect_reference(*commit({{coincident(20, seed), {Affine{}}}}), random_rays(800, seed + 30));
  }
}

TEST_P(Kernels, AnswerTheSameWhateverRoundingTheCallerHasSet) {
  const auto snapshot = commit({{soup(300, 1), {Affine{}}}});
  const std::vector<Ray> rays = random_rays(800, 2);
  const auto trace_all = [&](const TraceOptions& options) {
    std::vector<Hit> hits(rays.size());
    trace_closest(snapshot->view, {rays.data(), rays.size(), Cull::kNone, nullptr, hits.data(), nullptr}, options);
    return hits;
  };
  for (const TraceOptions& options : kWays) {
    const std::vector<Hit> expected = trace_all(options);
    std::fesetround(FE_UPWARD);
    const std::vector<Hit> hits = trace_all(options);
    const int rounding = std::fegetround();
    std::fesetround(FE_TONEAREST);
    EXPECT_EQ(rounding, FE_UPWARD) << "the caller's setting is gone";
    for (std::size_t i = 0; i < rays.size(); ++i) ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(Hit)), 0) << i;
  }
}

TEST_P(Kernels, MatchTheReferenceOnRaysAtEdgesAndVertices) {
  const MeshData box = box_of_grids(6);
  const auto snapshot = commit({{box, {Affine{}}}});
  const std::vector<Ray> rays = aimed_rays(box, 3000, 1);
  expect_reference(*snapshot, rays);
  for (const Ray& ray : rays) EXPECT_TRUE(reference_closest(*snapshot, ray, Cull::kNone).found());
}

// Boxes that are clipped to parts of triangles must not lose a hit or decide a tie.
TEST_P(Kernels, MatchTheReferenceOnTreesWithSpatialSplits) {
  BuildConfig config;
  config.builder = BuilderKind::kSpatial;
  config.duplication_budget = 4.0f;
  config.traversal_cost = 0.01f;  // cut as often as the budget allows
  const auto commit_split = [&](const MeshData& data, float scale = 1.0f, std::size_t least_percent = 125) {
    auto snapshot = commit({{data, {Affine{}}}}, scale, config);
    const TreeQuality& quality = snapshot->instances[0].blas->quality;
    EXPECT_GT(quality.reference_count, data.triangles.size() * least_percent / 100) << "hardly anything was cut";
    return snapshot;
  };
  for (std::uint32_t seed = 0; seed < 2; ++seed) {
    for (const float scale : {1.0f, 1e-20f, 1e9f}) {
      expect_reference(*commit_split(wide_soup(300, seed), scale, 100), random_rays(500, seed + 10, scale));
      expect_reference(*commit_split(slivers(300, seed), scale), random_rays(500, seed + 20, scale));
      expect_reference(*commit_split(coincident(20, seed), scale), random_rays(500, seed + 30, scale));
    }
    expect_reference(*commit_split(slivers(300, seed)), aimed_rays(slivers(300, seed), 500, seed + 40));
  }
  // Flat faces along the axes, rays at their edges and vertices; long edges between them, so that some are split.
  MeshData box = box_of_grids(4);
  const MeshData beams = slivers(200, 7);
  for (const Triangle& t : beams.triangles) {
    const auto at = [&](std::int32_t vertex) { return beams.positions[static_cast<std::size_t>(vertex)]; };
    box.add(at(t.x), at(t.y), at(t.z));
  }
  expect_reference(*commit_split(box), aimed_rays(box, 1500, 2));
  expect_reference(*commit({{soup(60, 1), many_places(20, 2)}, {slivers(60, 3), many_places(20, 4)}}, 1.0f, config),
                   random_rays(500, 5));
}

TEST_P(Kernels, MatchTheReferenceThroughInstances) {
  const auto snapshot = commit({{soup(40, 1), many_places(30, 2)}, {box_of_grids(2), many_places(20, 3)}});
  for (const Cull cull : {Cull::kNone, Cull::kBack}) expect_reference(*snapshot, random_rays(600, 4), cull);
}

TEST_P(Kernels, BreakTiesByOrderAndPrimitive) {
  // The same mesh at the same position, twelve times.
  const auto snapshot = commit({{box_of_grids(2), std::vector<Affine>(12)}});
  expect_reference(*snapshot, random_rays(600, 5));
}

TEST_P(Kernels, MatchTheReferenceAtExtremeScales) {
  for (const float scale : {1e-30f, 1e-20f, 1e-7f, 1e9f, 1e16f}) {
    const auto snapshot = commit({{soup(60, 1), many_places(3, 2)}, {slivers(60, 3), {Affine{}}}}, scale);
    expect_reference(*snapshot, random_rays(300, 6, scale));
    std::vector<Ray> distant = random_rays(300, 7, scale);
    for (Ray& ray : distant)
      ray.origin = ray.origin - ray.direction * 1e7, ray.t_min = 0, ray.t_max = kInfiniteDistance;
    expect_reference(*snapshot, distant);
  }
}

TEST_P(Kernels, MatchTheReferenceForDirectionsOfAnyLength) {
  const auto snapshot = commit({{soup(60, 1), many_places(3, 2)}});
  for (const double length : {1e-300, 1e-40, 1e-9, 1e9, 1e40, 1e300}) {
    std::vector<Ray> rays = random_rays(200, 8);
    for (Ray& ray : rays) ray.direction = ray.direction * length, ray.t_min = 0, ray.t_max = kInfiniteDistance;
    expect_reference(*snapshot, rays);
  }
}

// A single mesh without a transform traces most rays unchanged. These rays are exceptions: some components are zeros of
// either sign or very short, they begin far away, or they cannot hit anything.
TEST_P(Kernels, MatchTheReferenceForUnusualRaysAtALoneMesh) {
  constexpr double kComponents[] = {0.0, -0.0, 0x1p-21, -0x1p-20, 0x1p20, -0x1p21, 1.0};
  std::vector<Ray> rays = random_rays(7 * 7 * 7 * 3, 61);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    rays[i].direction = {kComponents[i % 7], kComponents[i / 7 % 7], kComponents[i / 49 % 7]};
    if (i % 3 == 0) rays[i].origin.x = -0.0;
    if (i % 5 == 0) rays[i].origin.y = 0.0;
    if (i % 11 == 0) rays[i].origin = rays[i].origin - rays[i].direction * 1e3;
    if (i % 13 == 0) rays[i].mask = 0;
    if (i % 17 == 0) rays[i].t_max = -kInfiniteDistance;
    if (i % 19 == 0) rays[i].t_min = rays[i].t_max = 0.0f;
  }
  expect_reference(*commit({{soup(300, 60), {Affine{}}}}), rays);
  expect_reference(*commit({{soup(300, 60), {Affine{}}}}), rays, Cull::kBack);
}

// Vector kernels start usual rays eight at a time: at each position among eight there is a ray that is barely usual, or
// barely unusual.
TEST_P(Kernels, MatchTheReferenceWhereOneRayOfEightIsUnusual) {
  for (const bool is_single : {true, false}) {
    const auto snapshot = commit({{soup(300, 62), is_single ? std::vector<Affine>(1) : many_places(10, 63)}});
    const double farthest =
        kNearby * static_cast<double>(snapshot->view.reach) / static_cast<double>(snapshot->view.scale);
    std::vector<Ray> rays = random_rays(8 * 8 * 16, 64);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (i % 8 != i / 8 % 8) continue;
      Ray& ray = rays[i];
      const auto kind = static_cast<int>(i / 64);
      const double nudge = 1.0 + 0x1p-24 * (kind % 4 - 1);
      if (kind < 4) ray.origin = ray.direction * (-farthest * nudge / largest_component(&ray.direction.x));
      if (kind < 4) ray.t_min = 0.0f, ray.t_max = kInfiniteDistance;
      if (kind >= 4 && kind < 8) ray.direction.x = kShortest * nudge;
      if (kind >= 8 && kind < 12) ray.direction.y = -kLongest * nudge;
      if (kind == 12) ray.direction.z = -0.0;
      if (kind == 13) ray.mask = 0;
      if (kind == 14) ray.t_min = std::nextafter(ray.t_max, kInfiniteDistance);
      if (kind == 15) ray.origin.z = std::numeric_limits<double>::quiet_NaN();
    }
    expect_reference(*snapshot, rays);
    expect_reference(*snapshot, rays, Cull::kBack);
  }
}

TEST_P(Kernels, TakeBadRaysForMisses) {
  const auto snapshot = commit({{box_of_grids(2), {Affine{}}}});
  const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Ray> rays;
  for (const double bad : {inf, -inf, nan, 1e308, -1e308, 5e-324}) {
    for (int axis = 0; axis < 3; ++axis) {
      Ray ray;
      ray.direction = {0, 0, 1};
      ray.origin[axis] = bad;
      rays.push_back(ray);
      ray.origin = {0, 0, 0};
      ray.direction = {0.5, 0.5, 0.5};
      ray.direction[axis] = bad;
      rays.push_back(ray);
    }
  }
  Ray ray;
  rays.push_back(ray);  // no direction
  ray.direction = {0, 0, 1};
  for (const float bad : {kInfiniteDistance, -kInfiniteDistance, std::numeric_limits<float>::quiet_NaN()}) {
    ray.t_min = bad, ray.t_max = kInfiniteDistance, rays.push_back(ray);
    ray.t_min = 0, ray.t_max = bad, rays.push_back(ray);
  }
  ray.t_min = 2, ray.t_max = 1, rays.push_back(ray);
  expect_reference(*snapshot, rays);
}

// Among rays of similar direction, some have a range that is infinitely far away, or a NaN. A packet keeps limits for
// all of its rays, which these must not corrupt.
TEST_P(Kernels, TakeNothingFromTheRaysBesideBadOnes) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto spoil = [&](Ray& ray, unsigned kind) {
    const float far = kind % 2 == 0 ? kInfiniteDistance : 1e38f;
    if (kind >= 6) ray.direction = ray.direction * 1e300;  // local t exceeds every double
    if (kind / 2 % 3 == 0) ray.t_min = ray.t_max = -far;
    if (kind / 2 % 3 == 1) ray.t_min = ray.t_max = far;
    if (kind / 2 % 3 == 2) ray.t_min = -kInfiniteDistance, ray.origin.y = far == kInfiniteDistance ? nan : 0.0;
  };
  for (const bool is_single : {true, false}) {
    const auto snapshot = commit({{soup(300, 1), is_single ? std::vector<Affine>(1) : many_places(10, 2)}});
    for (unsigned kind = 0; kind < 12; ++kind) {
      std::vector<Ray> rays(256);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        rays[i].origin = {0.1, -3.0, 0.2};
        rays[i].direction = {static_cast<double>(i % 16) / 40 - 0.2, 1.0, static_cast<double>(i / 16) / 40 - 0.2};
        if (i % 64 == 5 * kind || i % 11 == 10) spoil(rays[i], kind);
      }
      expect_reference(*snapshot, rays);
    }
  }
}

TEST_P(Kernels, AnswerEmptyScenes) {
  Scene scene;
  ThreadPool pool(1);
  CancelToken cancel;
  scene.commit(pool, cancel);
  expect_reference(*scene.snapshot(), random_rays(5, 1));
  scene.add_instances(std::vector<InstanceInput>{
      {scene.add_mesh(MeshData{}.mesh(), BuildConfig{}, Usage::kStatic), Affine{}, ~0u, {}}});
  scene.commit(pool, cancel);
  expect_reference(*scene.snapshot(), random_rays(5, 1));
}

TEST_P(Kernels, CountTheSameWork) {
  const auto snapshot = commit({{soup(200, 1), many_places(10, 2)}});
  const std::vector<Ray> rays = random_rays(500, 9);
  std::vector<Hit> hits(rays.size());
  std::vector<RayCounts> counts(rays.size()), alone(rays.size()), scalar(rays.size());
  trace_closest(snapshot->view, {rays.data(), rays.size(), Cull::kNone, counts.data(), hits.data(), nullptr});
  trace_closest(snapshot->view, {rays.data(), rays.size(), Cull::kNone, alone.data(), hits.data(), nullptr},
                {Strategy::kSingle, 0});
  set_active_kernels("scalar");
  trace_closest(snapshot->view, {rays.data(), rays.size(), Cull::kNone, scalar.data(), hits.data(), nullptr});
  const std::size_t bytes = rays.size() * sizeof(RayCounts);
  EXPECT_EQ(std::memcmp(counts.data(), alone.data(), bytes), 0);
  EXPECT_EQ(std::memcmp(counts.data(), scalar.data(), bytes), 0);
  std::size_t tested = 0;
  for (const RayCounts& count : counts) tested += count.primitives_tested;
  EXPECT_GT(tested, rays.size());
}

// Mixed instances of several meshes, including baked ones and triangles that coincide across meshes.
TEST_P(Kernels, MatchTheReferenceWhereMeshesMix) {
  Scene scene;
  Random random(3);
  for (int number = 0; number < 8; ++number) {
    const MeshData data = number < 2 ? box_of_grids(3) : number < 4 ? soup(number, 5) : slivers(60, 7);
    const std::int32_t mesh = scene.add_mesh(data.mesh(), {}, Usage::kStatic);
    std::vector<InstanceInput> inputs{{mesh, Affine{}, ~0u, {}}};
    for (const Affine& place : many_places(4, static_cast<std::uint32_t>(number / 2))) {
      inputs.push_back({mesh, place, ~0u, {}});
    }
    inputs.push_back({mesh, {{1, 0, 0}, {0, 0, 0}, {0, 0, 1}, to_double(random_point(random, 1.0f))}, ~0u, {}});
    scene.add_instances(inputs);
  }
  ThreadPool pool(1);
  CancelToken cancel;
  EXPECT_EQ(scene.commit(pool, cancel).baked_count, 8u);
  expect_reference(*scene.snapshot(), random_rays(600, 5));
  expect_reference(*scene.snapshot(), aimed_rays(box_of_grids(3), 600, 6), Cull::kBack);
}

TEST(Dispatch, RefusesUnknownKernels) {
  EXPECT_THROW(set_active_kernels("sse9"), InvalidArgument);
  EXPECT_STREQ(available_kernels().front()->name, "scalar");
}

#if defined(__aarch64__)
TEST(Dispatch, PrefersVectorsWhereverTheyAre) { EXPECT_STREQ(active_kernels().name, "neon"); }
#endif

}  // namespace
}  // namespace perfect_bvh::test
