// Curves and points as meshes: accepted and rejected input, numbers, boxes and their slices.
#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <tuple>

#include "blas/moved_mesh.h"
#include "core/errors.h"
#include "mesh/clip.h"
#include "tests/round_mesh_sets.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

using namespace test;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

template <class Call>
std::string complaint(const Call& call) {
  try {
    static_cast<void>(call());
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "";
}

TEST(RoundMesh, KnowsCurvesByTheirBalls) {
  RoundInput input;
  input.centres.resize(9);
  input.radii = {1, 1, 0, 0, 0, 2, /**/ 3, 0, 0};
  input.offsets = {0, 6, 9};
  const Mesh mesh = input.curves();
  ASSERT_EQ(mesh.primitive_count(), 4u);
  EXPECT_EQ(mesh.segments[0], 0u | kSegmentAfter);
  EXPECT_EQ(mesh.segments[1], 1u | kSegmentBefore);
  EXPECT_EQ(mesh.segments[2], 4u);  // after two segments that are dropped
  EXPECT_EQ(mesh.segments[3], 6u);
  EXPECT_EQ(left_out_count(mesh), 3u);
  EXPECT_EQ(given_ball_count(mesh), 9u);
  const std::array<std::uint32_t, 4> numbers{0, 0, 0, 1};
  const std::array<float, 4> halfway{0.1f, 0.3f, 0.9f, 0.25f};
  for (std::uint32_t i = 0; i < 4; ++i) {
    EXPECT_EQ(caller_number(mesh, i), numbers[i]);
    EXPECT_FLOAT_EQ(u_of_part(mesh, i, 0.5f), halfway[i]);
  }
}

// A chain whose first or last segment is dropped, or that has a single segment, is not closed.
TEST(RoundMesh, ClosesCyclicCurves) {
  RoundInput input;
  input.centres.resize(15);
  input.radii = {1, 1, 1, 1, /**/ 1, 1, 1, /**/ 0, 0, 1, 0, /**/ 1, 1, /**/ 1, 1};
  input.offsets = {0, 4, 7, 11, 13, 15};
  const std::vector<std::uint8_t> cyclic{1, 0, 1, 1, 0};
  const Mesh mesh = make_curves(input.balls(), input.offsets, CurveShape::kRound, "test", cyclic);
  ASSERT_EQ(mesh.primitive_count(), 9u);
  ASSERT_EQ(mesh.closed.size(), 1u);
  EXPECT_EQ(mesh.closed[0].first, 0u);
  EXPECT_EQ(mesh.closed[0].last, 2u);
  EXPECT_EQ(mesh.segments[0], 0u | kSegmentAfter | kSegmentBefore);
  EXPECT_EQ(mesh.segments[2], 2u | kSegmentAfter | kSegmentBefore);
  EXPECT_EQ(mesh.segments[4] & (kSegmentAfter | kSegmentBefore), kSegmentBefore);
  EXPECT_EQ(mesh.segments[6] & kSegmentAfter, 0u);
  for (const std::size_t count : {4u, 6u}) {
    const std::vector<std::uint8_t> wrong(count, 1);
    const std::string said =
        complaint([&] { return make_curves(input.balls(), input.offsets, CurveShape::kRound, "test", wrong); });
    EXPECT_EQ(said, "test: cyclic must have one entry for each curve, 5, or none, got " + std::to_string(count));
  }
}

TEST(RoundMesh, KnowsPointsByTheirNumbers) {
  RoundInput input;
  input.centres = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
  input.radii = {0, 1, 0, 2};
  const Mesh mesh = input.points();
  ASSERT_EQ(mesh.primitive_count(), 2u);
  EXPECT_EQ(caller_number(mesh, 0), 1u);
  EXPECT_EQ(caller_number(mesh, 1), 3u);
  EXPECT_EQ(mesh.balls[1].centre, (Vec3f{3, 0, 0}));
  EXPECT_EQ(left_out_count(mesh), 2u);
  EXPECT_EQ(given_ball_count(mesh), 4u);
  EXPECT_EQ(u_of_part(mesh, 0, 0.5f), 0.0f);
  input.radii = {5};
  EXPECT_EQ(input.points().balls[3].radius, 5.0f);
  EXPECT_TRUE(input.points().numbers.empty());
  input.radii = {0};
  EXPECT_EQ(input.points().primitive_count(), 0u);
  EXPECT_EQ(left_out_count(input.points()), 4u);
}

TEST(RoundMesh, RecentresDoubles) {
  const std::vector<Vec3d> centres{{1e6, 0, 0}, {1e6 + 1e-3, 0, 0}};
  const std::vector<double> radii{1e-4};
  const Mesh mesh = make_points(BallsGiven<double>{centres, radii}, "test");
  EXPECT_NEAR(mesh.centre.x, 1e6 + 0.5e-3, 1e-9);
  EXPECT_NEAR(mesh.balls[1].centre.x, 0.5e-3f, 1e-9f);
}

TEST(RoundMesh, NamesWhatItCannotTake) {
  RoundInput input = cloud(4, 0.1f, 0.1f);
  input.offsets = {0, 2, 4};
  const auto points_complaint = [&] { return complaint([&] { return input.points(); }); };
  const auto curves_complaint = [&] { return complaint([&] { return input.curves(); }); };
  EXPECT_EQ(points_complaint(), "");
  EXPECT_EQ(curves_complaint(), "");
  input.radii[2] = -0.5f;
  EXPECT_NE(points_complaint().find("test: radii[2] must be at least 0"), std::string::npos) << points_complaint();
  input.radii[2] = kNan;
  EXPECT_NE(curves_complaint().find("radii[2]"), std::string::npos);
  input.radii.pop_back();
  EXPECT_NE(points_complaint().find("radii must have one entry for each row of centers, 4"), std::string::npos);
  input.radii = {0.1f};
  input.centres[3].y = kNan;
  EXPECT_NE(points_complaint().find("centers[3]"), std::string::npos);
  EXPECT_NE(curves_complaint().find("points[3]"), std::string::npos);
  input.centres[3].y = 2e18f;
  EXPECT_NE(points_complaint().find("centers[3]"), std::string::npos);
  input.centres[3].y = 0;
  const std::vector<std::vector<std::int64_t>> wrong{{},           {1, 4},    {0, 2},       {0, 5},
                                                     {0, 3, 2, 4}, {0, 3, 4}, {0, 2, 2, 4}, {0, -3}};
  for (const auto& offsets : wrong) {
    input.offsets = offsets;
    EXPECT_NE(curves_complaint().find("curve_offsets"), std::string::npos) << offsets.size();
  }
}

TEST(RoundMesh, BoxesHoldTheirBalls) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> digits(-2.0f, 2.0f);
  std::uniform_int_distribution<int> exponent(-140, 55);
  for (int i = 0; i < 200'000; ++i) {
    const Ball ball{{std::ldexp(digits(random), exponent(random)), digits(random), 0.0f},
                    std::ldexp(std::abs(digits(random)), exponent(random))};
    const Aabb box = box_of(ball);
    for (int axis = 0; axis < 3; ++axis) {
      const auto centre = static_cast<long double>(ball.centre[axis]), radius = static_cast<long double>(ball.radius);
      ASSERT_LE(static_cast<long double>(box.lower[axis]), centre - radius);
      ASSERT_GE(static_cast<long double>(box.upper[axis]), centre + radius);
      ASSERT_GE(box.lower[axis] * 1.0000005f, -std::numeric_limits<float>::max());
    }
  }
}

// Every point of a primitive is in the slice, or the two slices, of its coordinate.
TEST(RoundMesh, SlicesHoldAllPoints) {
  std::mt19937 random(5);
  for (const NamedRound& input : round_meshes()) {
    for (std::size_t i = 0; i < input.mesh.primitive_count(); i += 3) {
      const Aabb whole = input.mesh.primitive_box(i);
      const int axis = static_cast<int>(random() % 3);
      std::vector<float> planes;
      for (const float share : {-0.2f, 0.1f, 0.3f, 0.35f, 0.6f, 1.0f}) {
        const float place = whole.lower[axis] + share * (whole.upper[axis] - whole.lower[axis]);
        if (planes.empty() || place > planes.back()) planes.push_back(place);
      }
      std::array<Box4, 8> slices;
      const bool is_point = input.mesh.kind == PrimitiveKind::kPoints;
      const std::size_t first = is_point ? i : input.mesh.segments[i] & kSegmentBall;
      slice_segment(input.mesh.balls[first], input.mesh.balls[is_point ? first : first + 1], axis, planes,
                    slices.data());
      for (int sample = 0; sample < 100; ++sample) {
        const Vec3d point = point_inside(input.mesh, i, random);
        std::size_t slice = 0;
        while (slice < planes.size() && point[axis] > static_cast<double>(planes[slice])) ++slice;
        ASSERT_TRUE(holds(to_aabb(slices[slice]), point)) << input.name << ", " << i << ", slice " << slice;
      }
    }
  }
}

// A slanted hair in sixteen slices: at most a twentieth more than the boxes of the parts of an endless cylinder.
TEST(RoundMesh, SlicesAreTight) {
  const Ball first{{0, 0, 0}, 0.01f}, last{{1, 1, 1}, 0.01f};
  std::vector<float> planes;
  for (int i = 1; i < 16; ++i) planes.push_back(static_cast<float>(i) / 16.0f);
  std::array<Box4, 16> slices;
  slice_segment(first, last, 0, planes, slices.data());
  for (std::size_t i = 1; i < 15; ++i) {
    const Vec3f extent = to_aabb(slices[i]).extent();
    const float best = 1.0f / 16.0f + 2.0f * 0.01f * std::sqrt(2.0f);
    EXPECT_NEAR(extent.x, 1.0f / 16.0f, 1e-5f);
    EXPECT_NEAR(extent.y, best, 0.001f * best);
    EXPECT_NEAR(extent.z, best, 0.001f * best);
  }
}

TEST(RoundMesh, MovesWithTheSamePrimitives) {
  ThreadPool pool(2);
  const auto spare = std::make_shared<SparePositions>();
  RoundInput input = cloud(1000, 0.1f, 0.2f);
  input.radii[7] = input.radii[500] = input.radii[501] = 0.0f;
  for (const bool is_points : {true, false}) {
    input.offsets = {0, 400, 1000};
    const Mesh before = is_points ? input.points() : input.curves();
    RoundInput other = cloud(1000, 0.3f, 0.4f, 9);
    other.offsets = input.offsets;
    const MovedBalls kept = move_balls(before, BallsGiven<float>{other.centres, {}}, spare, pool, "test");
    EXPECT_TRUE(kept.same_primitives);
    other.radii = input.radii;
    const Mesh expected = is_points ? other.points() : other.curves();
    ASSERT_EQ(kept.mesh->balls.size(), expected.balls.size());
    for (std::size_t i = 0; i < expected.balls.size(); ++i) {
      ASSERT_EQ(kept.mesh->balls[i].centre, expected.balls[i].centre);
      ASSERT_EQ(kept.mesh->balls[i].radius, expected.balls[i].radius);
    }
    EXPECT_EQ(kept.mesh->primitive_count(), expected.primitive_count());
    EXPECT_EQ(left_out_count(*kept.mesh), left_out_count(before));
    // A curve's segment is kept if one of its ends has a radius.
    for (const auto& [row, radius, keeps_segments] : {std::tuple{7u, 1.0f, true}, std::tuple{8u, 0.0f, false},
                                                      std::tuple{100u, 0.0f, true}, std::tuple{501u, 1.0f, false}}) {
      RoundInput changed = input;
      changed.radii[row] = radius;
      const MovedBalls anew = move_balls(before, changed.balls(), spare, pool, "test");
      EXPECT_EQ(anew.same_primitives, !is_points && keeps_segments) << row;
      EXPECT_EQ(anew.mesh->primitive_count(), (is_points ? changed.points() : changed.curves()).primitive_count());
    }
    EXPECT_NE(
        complaint([&] { return move_balls(before, cloud(999, 0.1f, 0.2f).balls(), spare, pool, "test"); }).find("999"),
        std::string::npos);
  }
}

}  // namespace
}  // namespace perfect_bvh
