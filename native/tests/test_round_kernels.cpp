// Every kernel gives for curves and points, with any number of rays in flight and bit for bit, the result of testing
// each of them: closest hits, occlusion, and lists of all hits.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "query/ray_walk.h"
#include "query/trace.h"
#include "tests/reference_trace.h"
#include "tests/round_mesh_sets.h"
#include "tests/scenes_to_trace.h"

namespace perfect_bvh::test {
namespace {

constexpr TraceOptions kWays[] = {
    {Strategy::kAuto, 0}, {Strategy::kPackets, 0}, {Strategy::kStream, 0}, {Strategy::kSingle, 0}};

struct PlacedMesh {
  Mesh mesh;
  std::vector<Affine> places{Affine{}};
};

std::shared_ptr<const Snapshot> commit_rounds(std::vector<PlacedMesh> parts, const BuildConfig& config = {}) {
  Scene scene;
  for (PlacedMesh& part : parts) {
    const std::int32_t mesh = scene.add_mesh(std::move(part.mesh), config, Usage::kStatic);
    std::vector<InstanceInput> inputs;
    for (const Affine& place : part.places) inputs.push_back({mesh, place, ~0u, {}});
    scene.add_instances(inputs);
  }
  ThreadPool pool(1);
  CancelToken cancel;
  scene.commit(pool, cancel);
  return scene.snapshot();
}

// Parallel blades on a ground, bent and pointed.
RoundInput lawn(int rows) {
  Random random(7);
  RoundInput input;
  for (int blade = 0; blade < rows * rows; ++blade) {
    Vec3f at{static_cast<float>(blade % rows) / static_cast<float>(rows) * 2 - 1,
             static_cast<float>(blade / rows) / static_cast<float>(rows) * 2 - 1, 0.0f};
    const Vec3f lean = random_point(random, 0.05f);
    for (int i = 0; i < 4; ++i) {
      input.centres.push_back(at), input.radii.push_back(0.01f * static_cast<float>(3 - i) / 3.0f);
      at = at + lean * static_cast<float>(i) + Vec3f{0, 0, 0.1f};
    }
    input.end_curve();
  }
  return input;
}

RoundInput zigzag(int corners, float radius) {
  RoundInput input;
  for (int i = 0; i < corners; ++i) {
    const float x = static_cast<float>(i) / static_cast<float>(corners) * 2 - 1;
    input.centres.push_back({x, i % 2 == 0 ? -0.7f : 0.7f, 0.2f * std::sin(5 * x)});
    input.radii.push_back(radius);
  }
  input.end_curve();
  return input;
}

RoundInput slanted_sticks(int count) {
  Random random(9);
  RoundInput input;
  for (int i = 0; i < count; ++i) {
    input.centres.push_back(random_point(random, 1.0f)), input.centres.push_back(random_point(random, 1.0f));
    const float radius = std::ldexp(1.0f, -static_cast<int>(random() % 20) - 4);
    input.radii.push_back(radius), input.radii.push_back(i % 3 == 0 ? radius : radius * uniform(random, 0, 1));
    input.end_curve();
  }
  return input;
}

// Random walks with steps shorter than the radius, some reversed and some of zero length.
RoundInput knots(int count) {
  Random random(10);
  RoundInput input;
  for (int i = 0; i < count; ++i) {
    Vec3f at = random_point(random, 1.0f);
    for (int k = 0; k < 12; ++k) {
      input.centres.push_back(at), input.radii.push_back(uniform(random, 0, 0.1f));
      if (random() % 5 != 0) at = at + random_point(random, 0.1f);
    }
    input.end_curve();
  }
  return input;
}

RoundInput balls_in_balls() {
  Random random(11);
  RoundInput input;
  for (int i = 0; i < 150; ++i) {
    input.centres.push_back(random_point(random, 0.2f)), input.radii.push_back(uniform(random, 0.01f, 1.0f));
  }
  return input;
}

// Several spheres, and several copies of each, at the same place.
RoundInput one_place() {
  RoundInput input;
  for (int i = 0; i < 200; ++i) {
    input.centres.push_back({0.25f, -0.5f, 0.125f}), input.radii.push_back(0.1f * static_cast<float>(1 + i % 5));
  }
  return input;
}

// From all around and from inside; half of the rays aim at spheres and close past them.
std::vector<Ray> rays_around(const Mesh& mesh, std::size_t count, std::uint32_t seed) {
  Aabb box;
  for (std::size_t i = 0; i < mesh.primitive_count(); ++i) box.grow(mesh.primitive_box(i));
  const Vec3f centre = (box.lower + box.upper) * 0.5f, half = (box.upper - box.lower) * 0.5f;
  Random random(seed);
  std::vector<Ray> rays(count);
  for (std::size_t i = 0; i < count; ++i) {
    Ray& ray = rays[i];
    const Ball& ball = mesh.balls[random() % mesh.balls.size()];
    const Vec3f inside = centre + random_point(random, 1.0f) * half;
    const Vec3f target = i % 2 == 0 ? ball.centre + random_point(random, 1.1f) * ball.radius : inside;
    const Vec3f origin = centre + random_point(random, i % 3 == 0 ? 1.0f : 4.0f) * half;
    ray.origin = to_double(origin), ray.direction = to_double(target - origin);
    if (i % 8 == 0) ray.direction.x = 0.0;
    if (i % 16 == 1) ray.direction.y = -0.0, ray.direction.z = 0.0;
    if (i % 5 == 2) ray.t_min = 0.25f, ray.t_max = uniform(random, 0.25f, 2.0f);
    if (i % 7 == 3) ray.direction = ray.direction * 1e-12;
    if (i % 11 == 4) ray.origin = ray.origin - ray.direction * 1e5;
    if (ray.direction == Vec3d{0, 0, 0}) ray.direction.x = 1.0;
  }
  return rays;
}

class RoundKernels : public testing::Test {
 protected:
  void TearDown() override { set_active_kernels(""); }

  // With all kernels, and all strategies.
  static void expect_reference(const Snapshot& snapshot, const std::vector<Ray>& rays, Cull cull = Cull::kNone) {
    std::vector<Hit> expected(rays.size());
    std::vector<std::vector<ReferenceHit>> all(rays.size());
    std::size_t hit_count = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      all[i] = reference_hits(snapshot, rays[i], cull);
      if (!all[i].empty()) expected[i] = all[i].front().hit, ++hit_count;
    }
    EXPECT_GT(hit_count, rays.size() / 20);
    for (const KernelTable* const kernels : available_kernels()) {
      SCOPED_TRACE(kernels->name);
      set_active_kernels(kernels->name);
      for (const TraceOptions& options : kWays) expect_hits(snapshot, rays, cull, expected, options);
      expect_lists(snapshot, rays, cull, all);
      if (testing::Test::HasFatalFailure()) return;
    }
  }

  static void expect_hits(const Snapshot& snapshot, const std::vector<Ray>& rays, Cull cull,
                          const std::vector<Hit>& expected, const TraceOptions& options) {
    std::vector<Hit> hits(rays.size());
    std::vector<std::uint8_t> occluded(rays.size());
    trace_closest(snapshot.view, {rays.data(), rays.size(), cull, nullptr, hits.data(), nullptr}, options);
    trace_any(snapshot.view, {rays.data(), rays.size(), cull, nullptr, nullptr, occluded.data()}, options);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(Hit)), 0)
          << "ray " << i << ", strategy " << static_cast<int>(options.strategy) << ": " << hits[i].t << " u "
          << hits[i].u << " primitive " << hits[i].primitive_index << ", expected " << expected[i].t << " u "
          << expected[i].u << " primitive " << expected[i].primitive_index;
      ASSERT_EQ(occluded[i] != 0, expected[i].found()) << "ray " << i;
    }
  }

  static void expect_lists(const Snapshot& snapshot, const std::vector<Ray>& rays, Cull cull,
                           const std::vector<std::vector<ReferenceHit>>& expected) {
    std::vector<FoundHit> found(1 << 16);
    std::vector<std::size_t> counts(1);
    for (std::size_t i = 0; i < rays.size(); i += 3) {
      const RayBatch batch{&rays[i], 1, cull};
      ASSERT_EQ(find_all_hits(snapshot.view, batch, {found.data(), found.size(), counts.data()}), 1u);
      std::vector<FoundHit> hits(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(counts[0]));
      const bool repeats = snapshot.view.repeats_triangles;
      ASSERT_TRUE(repeats || hits.size() == expected[i].size()) << "ray " << i;
      const auto key = [](const FoundHit& hit) {
        return std::tuple(hit.t, hit.instance_index, hit.primitive_index, hit.v);
      };
      std::sort(hits.begin(), hits.end(), [&](const FoundHit& a, const FoundHit& b) { return key(a) < key(b); });
      hits.erase(
          std::unique(hits.begin(), hits.end(), [&](const FoundHit& a, const FoundHit& b) { return key(a) == key(b); }),
          hits.end());
      ASSERT_EQ(hits.size(), expected[i].size()) << "ray " << i;
      for (std::size_t k = 0; k < hits.size(); ++k) {
        ASSERT_EQ(hits[k].t, expected[i][k].t) << "ray " << i;
        ASSERT_EQ(hits[k].u, expected[i][k].hit.u) << "ray " << i;
        ASSERT_EQ(hits[k].primitive_index, expected[i][k].hit.primitive_index) << "ray " << i;
      }
    }
  }

  static void expect_reference(Mesh mesh, std::size_t ray_count, std::uint32_t seed) {
    const std::vector<Ray> rays = rays_around(mesh, ray_count, seed);
    expect_reference(*commit_rounds({{std::move(mesh)}}), rays);
  }
};

TEST_F(RoundKernels, ALawn) { expect_reference(lawn(12).curves(), 20000, 1); }
TEST_F(RoundKernels, Fur) { expect_reference(fur(60, 8, 0.01f, 0.3f).curves(), 20000, 2); }
TEST_F(RoundKernels, ZigzagsThinAndThick) {
  expect_reference(zigzag(200, 1e-3f).curves(), 10000, 3);
  expect_reference(zigzag(100, 0.05f).curves(), 10000, 4);
}
TEST_F(RoundKernels, SlantedSticks) { expect_reference(slanted_sticks(300).curves(), 20000, 5); }
TEST_F(RoundKernels, Knots) { expect_reference(knots(40).curves(), 20000, 6); }
TEST_F(RoundKernels, BallsInBalls) { expect_reference(balls_in_balls().points(), 20000, 7); }
TEST_F(RoundKernels, ManyPointsInOnePlace) { expect_reference(one_place().points(), 10000, 8); }
TEST_F(RoundKernels, APointCloud) { expect_reference(cloud(1000, 0.0f, 0.02f).points(), 10000, 9); }

TEST_F(RoundKernels, MeshesAsTreesAreTriedOn) {
  for (NamedRound& input : round_meshes()) {
    SCOPED_TRACE(input.name);
    if (input.mesh.primitive_count() == 0) continue;
    expect_reference(std::move(input.mesh), 2000, 10);
  }
}

// Parallel rays, which are traced in packets.
TEST_F(RoundKernels, ImagesFromACamera) {
  const Mesh meshes[] = {lawn(30).curves(), knots(40).curves(), cloud(2000, 0.0f, 0.02f).points()};
  for (const Mesh& mesh : meshes) {
    std::vector<Ray> rays(96 * 64);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const double x = static_cast<double>(i % 96) / 48 - 1, y = static_cast<double>(i / 96) / 32 - 1;
      rays[i].origin = {0.1, -2.5, 1.2}, rays[i].direction = Vec3d{0.6 * x, 1.0, 0.6 * y - 0.45};
    }
    expect_reference(*commit_rounds({{mesh}}), rays);
    expect_reference(*commit_rounds({{mesh, {Affine{}, {{0, 2, 0}, {-2, 0, 0}, {0, 0, 2}, {1, 4, 0}}}}}), rays);
  }
}

TEST_F(RoundKernels, CountTheSameWork) {
  const Mesh mesh = knots(40).curves();
  const auto snapshot = commit_rounds({{mesh}});
  const std::vector<Ray> rays = rays_around(mesh, 1000, 18);
  std::vector<Hit> hits(rays.size());
  std::vector<RayCounts> first;
  for (const KernelTable* const kernels : available_kernels()) {
    set_active_kernels(kernels->name);
    std::vector<RayCounts> counts(rays.size());
    trace_closest(snapshot->view, {rays.data(), rays.size(), Cull::kNone, counts.data(), hits.data(), nullptr});
    std::size_t tested = 0;
    for (const RayCounts& count : counts) tested += count.primitives_tested;
    EXPECT_GT(tested, rays.size());
    if (first.empty()) first = counts;
    EXPECT_EQ(std::memcmp(counts.data(), first.data(), counts.size() * sizeof(RayCounts)), 0) << kernels->name;
  }
}

TEST_F(RoundKernels, FromOutside) {
  const Mesh mesh = knots(40).curves();
  expect_reference(*commit_rounds({{mesh}}), rays_around(mesh, 5000, 11), Cull::kBack);
}

TEST_F(RoundKernels, TreesOfAnyBuilder) {
  const Mesh mesh = slanted_sticks(200).curves();
  const std::vector<Ray> rays = rays_around(mesh, 3000, 12);
  for (const auto& builder : kBuilders) {
    SCOPED_TRACE(builder.name);
    BuildConfig config;
    config.builder = builder.kind;
    config.duplication_budget = 4.0f;
    expect_reference(*commit_rounds({{mesh}}, config), rays);
  }
}

// Turned, sheared, mirrored and flat: spheres become ellipsoids. Triangles are mixed in.
TEST_F(RoundKernels, InstancesAmongTriangles) {
  const Mesh curves = knots(10).curves(), points = cloud(40, 0.01f, 0.2f).points();
  const std::vector<Ray> rays = random_rays(5000, 13);
  const std::vector<PlacedMesh> parts{
      {curves, many_places(10, 14)}, {soup(40, 1).mesh(), many_places(10, 15)}, {points, many_places(10, 16)}};
  expect_reference(*commit_rounds(parts), rays);
  expect_reference(*commit_rounds(parts), rays, Cull::kBack);
}

TEST_F(RoundKernels, WalksEndAtTheSameHit) {
  const Mesh mesh = knots(40).curves();
  const auto snapshot = commit_rounds({{mesh}});
  CancelToken cancel;
  for (const Ray& ray : rays_around(mesh, 300, 17)) {
    const RayWalk walk = walk_ray(*snapshot, ray, Cull::kNone, cancel);
    const Hit expected = reference_closest(*snapshot, ray, Cull::kNone);
    const double nearest = walk.count() == 0 ? static_cast<double>(kInfiniteDistance) : walk.nearest_t.back();
    ASSERT_EQ(static_cast<float>(nearest) + 0.0f, expected.t);
  }
}

}  // namespace
}  // namespace perfect_bvh::test
