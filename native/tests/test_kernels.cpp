// Every kernel, with any number of rays under way, gives bit for bit what trying every triangle gives: on soups,
// slivers, coincident and degenerate triangles, instances of every kind, extreme scales and directions.
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "core/errors.h"
#include "scene/scene.h"
#include "scene/trace.h"
#include "tests/reference_trace.h"
#include "traverse/dispatch.h"

namespace perfect_bvh::test {
namespace {

using Random = std::mt19937;
using Triangle = Vec3<std::int32_t>;

float uniform(Random& random, float low, float high) {
  return low + (high - low) * (static_cast<float>(random() >> 8) * 0x1p-24f);
}

Vec3f random_point(Random& random, float size) {
  return {uniform(random, -size, size), uniform(random, -size, size), uniform(random, -size, size)};
}

struct MeshData {
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;

  void add(Vec3f a, Vec3f b, Vec3f c) {
    const auto first = static_cast<std::int32_t>(positions.size());
    positions.insert(positions.end(), {a, b, c});
    triangles.push_back({first, first + 1, first + 2});
  }
  [[nodiscard]] TriangleMesh mesh(float scale = 1.0f) const {
    std::vector<Vec3f> scaled = positions;
    for (Vec3f& p : scaled) p = p * scale;
    return make_mesh(std::span<const Vec3f>(scaled), triangles, "test");
  }
};

MeshData soup(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  MeshData data;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f at = random_point(random, 1.0f);
    data.add(at + random_point(random, 0.2f), at + random_point(random, 0.2f), at + random_point(random, 0.2f));
  }
  return data;
}

// Needles along random lines, most of them far thinner than float can tell from nothing.
MeshData slivers(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  MeshData data;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f a = random_point(random, 1.0f), b = random_point(random, 1.0f);
    const float width = std::ldexp(1.0f, -static_cast<int>(random() % 26));
    data.add(a, b, (a + b) * 0.5f + random_point(random, width));
  }
  return data;
}

// A closed, regular surface: shared vertices, coplanar neighbours, axis-parallel edges.
MeshData box_of_grids(std::int32_t cells) {
  MeshData data;
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      const auto first = static_cast<std::int32_t>(data.positions.size());
      for (std::int32_t i = 0; i <= cells; ++i) {
        for (std::int32_t j = 0; j <= cells; ++j) {
          Vec3f p{};
          p[axis] = side == 0 ? -1.0f : 1.0f;
          p[(axis + 1) % 3] = -1.0f + 2.0f * static_cast<float>(i) / static_cast<float>(cells);
          p[(axis + 2) % 3] = -1.0f + 2.0f * static_cast<float>(j) / static_cast<float>(cells);
          data.positions.push_back(p);
        }
      }
      for (std::int32_t i = 0; i < cells; ++i) {
        for (std::int32_t j = 0; j < cells; ++j) {
          const std::int32_t a = first + i * (cells + 1) + j, b = a + cells + 1;
          data.triangles.push_back({a, b, b + 1});
          data.triangles.push_back({a, b + 1, a + 1});
        }
      }
    }
  }
  return data;
}

// Each triangle several times, in every winding and order, and degenerate ones between them.
MeshData coincident(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  MeshData data;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f a = random_point(random, 1.0f), b = random_point(random, 1.0f), c = random_point(random, 1.0f);
    data.add(a, b, c), data.add(a, b, c), data.add(b, c, a), data.add(c, b, a);
    data.add(a, a, b), data.add(a, a, a), data.add(a, b, (a + b) * 0.5f);
  }
  return data;
}

std::vector<Ray> random_rays(std::size_t count, std::uint32_t seed, double scale = 1.0) {
  Random random(seed);
  std::vector<Ray> rays(count);
  for (Ray& ray : rays) {
    const Vec3f origin = random_point(random, 2.0f), target = random_point(random, 1.0f);
    ray.origin = to_double(origin) * scale;
    ray.direction = to_double(target - origin) * scale;
    const auto kind = random() % 8;
    if (kind == 0) ray.direction.x = 0.0;
    if (kind == 1) ray.direction.y = -0.0, ray.direction.z = 0.0;
    if (kind == 2) ray.t_min = 0.25f, ray.t_max = uniform(random, 0.25f, 2.0f);
    if (kind == 3) ray.mask = random() & 7;
  }
  return rays;
}

// Rays at the vertices and edge points of a mesh, from inside it.
std::vector<Ray> aimed_rays(const MeshData& data, std::size_t count, std::uint32_t seed) {
  Random random(seed);
  std::vector<Ray> rays(count);
  for (Ray& ray : rays) {
    const Triangle t = data.triangles[random() % data.triangles.size()];
    const Vec3f a = data.positions[static_cast<std::size_t>(t.x)], b = data.positions[static_cast<std::size_t>(t.y)];
    const Vec3f origin = random_point(random, 0.5f);
    const Vec3f target = random() % 2 ? a : a + (b - a) * uniform(random, 0.0f, 1.0f);
    ray.origin = to_double(origin);
    ray.direction = to_double(target - origin);
  }
  return rays;
}

struct Placed {
  MeshData mesh;
  std::vector<Affine> places;
};

std::shared_ptr<const Snapshot> commit(const std::vector<Placed>& parts, float scale = 1.0f,
                                       const BuildConfig& config = {}) {
  Scene scene;
  std::uint32_t mask = 1;
  for (const Placed& part : parts) {
    const std::int32_t mesh = scene.add_mesh(part.mesh.mesh(scale), config, Usage::kStatic);
    std::vector<InstanceInput> inputs;
    for (Affine place : part.places) {
      place.translation = place.translation * static_cast<double>(scale);
      inputs.push_back({mesh, place, mask, {}});
      mask = mask == 4 ? 1 : mask * 2;
    }
    scene.add_instances(inputs);
  }
  ThreadPool pool(1);
  CancelToken cancel;
  scene.commit(pool, cancel);
  return scene.snapshot();
}

std::vector<Affine> many_places(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  std::vector<Affine> places(count);
  for (Affine& place : places) {
    const auto column = [&] { return to_double(random_point(random, 1.0f)); };
    place = {column(), column(), column(), to_double(random_point(random, 3.0f))};
    if (random() % 4 == 0) place.x = place.x * 1e-3;
    if (random() % 4 == 0) place = {{0.1, 0, 0}, {0, 0.1, 0}, {0, 0, -0.1}, place.translation};
  }
  return places;
}

constexpr TraceOptions kWays[] = {{Strategy::kAuto, 0},
                                  {Strategy::kPackets, 0},
                                  {Strategy::kStream, 0},
                                  {Strategy::kStream, 5},
                                  {Strategy::kSingle, 0}};

class Kernels : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override { set_active_kernels(GetParam()); }
  void TearDown() override { set_active_kernels(""); }

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

std::vector<std::string> kernel_names() {
  std::vector<std::string> names;
  for (const KernelTable* table : available_kernels()) names.push_back(table->name);
  return names;
}
INSTANTIATE_TEST_SUITE_P(All, Kernels, testing::ValuesIn(kernel_names()), [](const auto& test) { return test.param; });

TEST_P(Kernels, MatchTheReferenceOnSingleMeshes) {
  for (std::uint32_t seed = 0; seed < 3; ++seed) {
    expect_reference(*commit({{soup(300, seed), {Affine{}}}}), random_rays(800, seed + 10));
    expect_reference(*commit({{slivers(300, seed), {Affine{}}}}), random_rays(800, seed + 20));
    expect_reference(*commit({{coincident(20, seed), {Affine{}}}}), random_rays(800, seed + 30));
  }
}

TEST_P(Kernels, MatchTheReferenceOnRaysAtEdgesAndVertices) {
  const MeshData box = box_of_grids(6);
  const auto snapshot = commit({{box, {Affine{}}}});
  const std::vector<Ray> rays = aimed_rays(box, 3000, 1);
  expect_reference(*snapshot, rays);
  for (const Ray& ray : rays) EXPECT_TRUE(reference_closest(*snapshot, ray, Cull::kNone).found());
}

// Triangles across all of the space that they share.
MeshData wide_soup(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  MeshData data;
  for (std::size_t i = 0; i < count; ++i) {
    data.add(random_point(random, 1.0f), random_point(random, 1.0f), random_point(random, 1.0f));
  }
  return data;
}

// Boxes that are clipped to parts of triangles must lose no hit and decide no tie.
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
  // Flat faces along the axes, rays at their edges and vertices; long edges between them, so that some are cut.
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
  for (const Cull cull : {Cull::kNone, Cull::kBack, Cull::kFront})
    expect_reference(*snapshot, random_rays(600, 4), cull);
}

TEST_P(Kernels, BreakTiesByOrderAndPrimitive) {
  // The same mesh in the same place, twelve times.
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

TEST(Dispatch, RefusesUnknownKernels) {
  EXPECT_THROW(set_active_kernels("sse9"), InvalidArgument);
  EXPECT_STREQ(available_kernels().front()->name, "scalar");
}

}  // namespace
}  // namespace perfect_bvh::test
