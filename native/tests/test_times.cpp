// Rays with individual times. Each has, bit for bit, the answer of a scene whose vertices are at their positions at
// that time, with the trees of that scene; and that of instances placed for that time, up to the rounding of their
// maps.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "math/turning.h"
#include "query/trace.h"
#include "tests/scenes_to_trace.h"
#include "tlas/turns.h"

namespace perfect_bvh::test {
namespace {

constexpr StepTimes kTwoSteps{0.0f, 1.0f, 1};

// Moves every vertex by at most `by`.
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
    const std::int32_t mesh = scene.add_mesh(data.mesh(), {}, Usage::kDeforming);
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

INSTANTIATE_TEST_SUITE_P(All, Times, testing::ValuesIn(kernel_names()), Times::name_of);

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

// Rays of a camera, so that they are traced in packets, each with its own time; some are invalid.
std::vector<Ray> camera_rays(std::size_t side) {
  Random random(4);
  std::vector<Ray> rays;
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < side; ++x) {
      Ray ray;
      ray.origin = {0.1, 0.2, 6.0};
      const auto across = [side](std::size_t i) {
        return (static_cast<double>(i) + 0.5) / static_cast<double>(side) - 0.5;
      };
      ray.direction = {0.7 * across(x), 0.7 * across(y), -1.0};
      ray.time = uniform(random, 0.0f, 1.0f);
      rays.push_back(ray);
    }
  }
  rays[77].time = -0.5f, rays[500].time = 1.5f;
  return rays;
}

TEST_P(Times, EveryStrategyGivesTheSameBits) {
  const MeshData ground = box_of_grids(5), small = box_of_grids(2);
  for (const bool is_mostly_still : {true, false}) {
    Scene scene;
    add(scene, ground, {is_mostly_still ? Affine{} : Affine{{0.2, 0, 0}, {0, 0.2, 0}, {0, 0, 0.2}, {1, 1, 0}}});
    std::vector<Affine> places;
    for (int i = 0; i < 4; ++i)
      places.push_back({{0.2, 0, 0}, {0, 0.2, 0}, {0, 0, 0.2}, {0.6 * i - 1.0, 0.2 * i, 1.3}});
    const std::int32_t mesh = add(scene, small, places);
    std::vector<Vec3f> steps = small.positions;
    const std::vector<Vec3f> later = shaken(small, 0.2f, 3);
    steps.insert(steps.end(), later.begin(), later.end());
    scene.set_mesh_motion(mesh, std::span<const Vec3f>(steps), kTwoSteps);
    const std::int32_t id = 2;
    constexpr double kTurn[24] = {0.2, 0,    0, 0,   0,   0.2, 0, 0.2, 0, 0, 0.2, 1.3,
                                  0,   -0.2, 0, 0.3, 0.2, 0,   0, 0,   0, 0, 0.2, 1.3};
    scene.set_instance_motion(std::span(&id, 1), Matrices<double>{kTurn, 2, 3}, kTwoSteps);
    const auto snapshot = committed(scene);
    EXPECT_EQ(snapshot->view.is_mostly_still, is_mostly_still);
    const std::vector<Ray> rays = camera_rays(48);
    std::vector<Hit> alone(rays.size());
    trace_closest(*snapshot, rays, alone, Cull::kNone, {}, Strategy::kSingle);
    std::size_t moving = 0;
    for (const Hit& hit : alone) moving += hit.found() && hit.instance_index > 0 ? 1 : 0;
    EXPECT_GT(moving, 50u);
    EXPECT_FALSE(alone[77].found() || alone[500].found());
    for (const Strategy strategy : {Strategy::kAuto, Strategy::kStream, Strategy::kPackets}) {
      for (const Cull cull : {Cull::kNone, Cull::kBack}) {
        std::vector<Hit> expected(rays.size()), hits(rays.size());
        std::vector<std::uint8_t> occluded(rays.size());
        trace_closest(*snapshot, rays, expected, cull, {}, Strategy::kSingle);
        const std::size_t in_packets = trace_closest(*snapshot, rays, hits, cull, {}, strategy);
        trace_occluded(*snapshot, rays, occluded, cull, {}, strategy);
        const bool has_packets = std::string_view(active_kernels().name) != "scalar";
        const bool may_pack = strategy == Strategy::kPackets || (strategy == Strategy::kAuto && is_mostly_still);
        EXPECT_EQ(in_packets > 0, has_packets && may_pack);
        for (std::size_t i = 0; i < rays.size(); ++i) {
          ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(Hit)), 0) << "ray " << i;
          ASSERT_EQ(occluded[i] != 0, expected[i].found()) << "ray " << i;
        }
      }
    }
  }
}

Affine rotated(Vec3d axis, double angle, double size) {
  const Vec3d k = axis * (1.0 / length(axis));
  const double c = std::cos(angle), s = std::sin(angle);
  const auto turned = [&](Vec3d v) { return (v * c + cross(k, v) * s + k * (dot(k, v) * (1.0 - c))) * size; };
  return {turned({1, 0, 0}), turned({0, 1, 0}), turned({0, 0, 1}), {}};
}

Affine narrowed(const Affine& map) {
  Affine narrow = map;
  for (Vec3d* column : {&narrow.x, &narrow.y, &narrow.z, &narrow.translation}) *column = to_double(to_float(*column));
  return narrow;
}

// Compares rays mapped back with the inverse of the instance's map.
void expect_back(const Turns& turns, double tolerance) {
  for (const float time : {0.0f, 0.125f, 0.3f, 0.5f, 0.77f, 1.0f}) {
    const Moment moment = moment_at(turns.times, time);
    const TurnBack& back = turns.backs[moment.step];
    ASSERT_EQ(back.is_ready, 1);
    const Affine inverted = inverse(turns.at(time));
    EXPECT_EQ(back.is_mirrored != 0, turns.at(time).determinant() < 0);
    const double origin[4] = {0.3, -2.0, 1.7, 0}, direction[4] = {-0.4, 0.9, 0.2, 0},
                 centre[4] = {0.5, 0.25, -0.125, 0};
    double from[4], along[4];
    turn_ray_back(back, static_cast<double>(moment.later), centre, 4.0, 1.0, origin, direction, from, along);
    const Vec3d expected = (inverted.point({origin[0], origin[1], origin[2]}) - Vec3d{0.5, 0.25, -0.125}) * 4.0;
    const Vec3d expected_along = inverted.vector({direction[0], direction[1], direction[2]}) * 4.0;
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(from[axis], expected[axis], tolerance) << "at " << time;
      EXPECT_NEAR(along[axis], expected_along[axis], tolerance) << "at " << time;
    }
    EXPECT_TRUE(from[3] == 0.0 && along[3] == 0.0);
  }
}

TEST(Turns, AreTakenBackAsTheyAreTaken) {
  constexpr double kAngles[] = {0.0, 1e-9, 1e-4, 0.3, 1.5, 3.1};
  for (const double angle : kAngles) {
    for (const double size : {1.0, -0.7}) {  // turned inside out
      const Affine start = rotated({1, 2, -1}, 0.4, size);
      Affine end = rotated({1, 2, -1}, 0.4, 1.0), further = rotated({-0.3, 1, 2}, angle, size);
      end = {further.vector(end.x), further.vector(end.y), further.vector(end.z), {0.5, 0.25, -3.0}};
      Turns turns, noisy;
      turns.times = noisy.times = kTwoSteps;
      ASSERT_TRUE(turns.add(start) && turns.add(end) && noisy.add(narrowed(start)) && noisy.add(narrowed(end)));
      turns.finish(), noisy.finish();
      if (angle == 0.0) {
        EXPECT_EQ(noisy.backs[0].grows, 0);
      } else if (angle > 1e-6) {
        EXPECT_NE(noisy.backs[0].grows, 0);  // because its matrices are rounded
      }
      expect_back(turns, 1e-13);
      expect_back(noisy, 1e-12);
    }
  }
}

TEST(Turns, ThatStretchAreNotMadeReady) {
  Turns turns;
  turns.times = kTwoSteps;
  const Affine larger{{1.001, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}};
  ASSERT_TRUE(turns.add(Affine{}) && turns.add(larger));
  turns.finish();
  EXPECT_EQ(turns.backs[0].is_ready, 0);
  EXPECT_EQ(turns.backs[1].is_ready, 1);  // it does not change after that
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
