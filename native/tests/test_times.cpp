// Rays at times of their own: each is answered, bit for bit, as by a scene of the vertices where they are then, whose
// trees are its own; and as by instances that were placed where they are then, up to the rounding of their maps.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "query/trace.h"
#include "tests/scenes_to_trace.h"
#include "tlas/turns.h"

namespace perfect_bvh::test {
namespace {

constexpr StepTimes kTwoSteps{0.0f, 1.0f, 1};

// Where every vertex goes, by so much at most.
std::vector<Vec3f> shaken(const MeshData& data, float by, std::uint32_t seed) {
  Random random(seed);
  std::vector<Vec3f> positions = data.positions;
  for (Vec3f& position : positions) position = position + random_point(random, by);
  return positions;
}

std::vector<Vec3f> between(const std::vector<Vec3f>& from, const std::vector<Vec3f>& to, float time) {
  const Moment moment = moment_at(kTwoSteps, time);
  std::vector<Vec3f> positions = moment.step == 0 ? from : to;
  for (std::size_t i = 0; moment.is_between() && i < from.size(); ++i) {
    positions[i] = {interpolate(moment, from[i].x, to[i].x), interpolate(moment, from[i].y, to[i].y),
                    interpolate(moment, from[i].z, to[i].z)};
  }
  return positions;
}

std::shared_ptr<const Snapshot> committed(Scene& scene) {
  CancelToken never;
  scene.commit(ThreadPool::shared(), never);
  return scene.snapshot();
}

class Times : public KernelTest {
 protected:
  static std::int32_t add(Scene& scene, const MeshData& data, const std::vector<Affine>& places) {
    BuildConfig config;
    config.layout = GetParam().layout;
    const std::int32_t mesh = scene.add_mesh(data.mesh(), config, Usage::kDeforming);
    std::vector<InstanceInput> inputs;
    for (const Affine& place : places) inputs.push_back({mesh, place, 0xFFFFFFFFu, {}});
    scene.add_instances(inputs);
    return mesh;
  }

  static void expect_same(const Snapshot& moving, const Snapshot& still, std::vector<Ray> rays, float time) {
    std::vector<Hit> hits(rays.size()), expected(rays.size());
    trace_closest(still, rays, expected);
    for (Ray& ray : rays) ray.time = time;
    trace_closest(moving, rays, hits);
    std::vector<std::uint8_t> occluded(rays.size());
    trace_occluded(moving, rays, occluded);
    std::size_t found = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(Hit)), 0) << "ray " << i << " at " << time;
      ASSERT_EQ(occluded[i] != 0, hits[i].found()) << "ray " << i << " at " << time;
      found += hits[i].found() ? 1 : 0;
    }
    EXPECT_GT(found, rays.size() / 20);
  }
};

INSTANTIATE_TEST_SUITE_P(All, Times, testing::ValuesIn(kernel_cases()), Times::name_of);

TEST_P(Times, AMovingMeshIsBitForBitThatOfTheMoment) {
  const std::vector<MeshData> sets = {soup(300, 1), slivers(300, 2), box_of_grids(4), coincident(20, 3)};
  for (std::uint32_t seed = 0; seed < sets.size(); ++seed) {
    const MeshData& from = sets[seed];
    MeshData to = from;
    to.positions = shaken(from, 0.3f, seed);
    Scene scene;
    std::vector<Vec3f> steps = from.positions;
    steps.insert(steps.end(), to.positions.begin(), to.positions.end());
    scene.set_mesh_motion(add(scene, from, {Affine{}}), std::span<const Vec3f>(steps), kTwoSteps);
    const auto moving = committed(scene);
    for (const float time : {0.0f, 0.25f, 0.3f, 0.999f, 1.0f}) {
      MeshData now = from;
      now.positions = between(from.positions, to.positions, time);
      Scene still;
      add(still, now, {Affine{}});
      expect_same(*moving, *committed(still), random_rays(500, seed + 10), time);
    }
  }
}

TEST_P(Times, ATurningInstanceIsWhereItIsAtTheMoment) {
  Random random(5);
  const MeshData data = box_of_grids(3);
  Scene scene;
  add(scene, data, {Affine{}, Affine{}});
  const Affine start{{0.8, 0.1, 0}, {0, 0.9, 0.2}, {0.1, 0, 0.7}, {0.1, 0, 0}};
  const Affine end{{0, 0.6, 0}, {-0.9, 0, 0.1}, {0, 0.1, 0.8}, {0, 0.2, -0.1}};
  Turns turns;
  turns.times = kTwoSteps;
  ASSERT_TRUE(turns.add(start) && turns.add(end));
  double matrices[4][12];
  const Affine steps[4] = {start, Affine{}, end, Affine{}};
  for (int i = 0; i < 4; ++i) {
    for (int row = 0; row < 3; ++row) {
      const Affine& map = steps[i];
      const double entries[4] = {map.x[row], map.y[row], map.z[row], map.translation[row]};
      std::copy_n(entries, 4, matrices[i] + 4 * row);
    }
  }
  const std::int32_t ids[2] = {0, 1};
  scene.set_instance_motion(ids, Matrices<double>{&matrices[0][0], 4, 3}, kTwoSteps);
  const auto moving = committed(scene);
  for (const float time : {0.0f, 0.1f, 0.5f, 0.9f, 1.0f}) {
    Scene still;
    add(still, data, {turns.at(time), Affine{}});
    const auto snapshot = committed(still);
    std::vector<Ray> rays = random_rays(800, 7);
    std::vector<Hit> hits(rays.size()), expected(rays.size());
    trace_closest(*snapshot, rays, expected);
    for (Ray& ray : rays) ray.time = time;
    trace_closest(*moving, rays, hits);
    std::size_t other = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const bool is_same = hits[i].instance_index == expected[i].instance_index && hits[i].found();
      if (hits[i].instance_index != expected[i].instance_index) ++other;
      const float gap = is_same ? std::abs(hits[i].t - expected[i].t) : 0.0f;
      EXPECT_LE(gap, 1e-5f * (1.0f + std::abs(hits[i].found() ? expected[i].t : 0.0f)));
    }
    EXPECT_LE(other, 2u) << "rays that pass an edge";
  }
}

TEST(Turns, GoEvenlyFromEachStepToTheNext) {
  Turns turns;
  turns.times = {0.25f, 4.0f, 2};  // from .25 to .75
  const Affine quarter{{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}, {2, 0, 0}}, half{{-1, 0, 0}, {0, -1, 0}, {0, 0, 3}, {2, 0, 4}};
  ASSERT_TRUE(turns.add(Affine{}) && turns.add(quarter) && turns.add(half));
  const auto expect_near = [&](float time, const Affine& expected) {
    const Affine map = turns.at(time);
    const Vec3d gaps[4] = {map.x - expected.x, map.y - expected.y, map.z - expected.z,
                           map.translation - expected.translation};
    for (const Vec3d gap : gaps) EXPECT_LT(length(gap), 1e-14) << "at " << time;
  };
  expect_near(0.0f, Affine{});
  expect_near(0.25f, Affine{});
  expect_near(0.5f, quarter);
  expect_near(0.75f, half);
  expect_near(1.0f, half);
  const double c = std::sqrt(0.5);
  expect_near(0.375f, {{c, c, 0}, {-c, c, 0}, {0, 0, 1}, {1, 0, 0}});
  expect_near(0.625f, {{-c, c, 0}, {-c, -c, 0}, {0, 0, 2}, {2, 0, 2}});
  EXPECT_FALSE(turns.add({{1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {}}));
  EXPECT_EQ(turns.steps.size(), 3u);
}

}  // namespace
}  // namespace perfect_bvh::test
