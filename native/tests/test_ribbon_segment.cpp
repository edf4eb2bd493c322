// Ribbons computed by hand: where lines hit one segment, and which of two they hit.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "math/curve_joint.h"

namespace perfect_bvh {
namespace {

RoundRay ray_of(Vec3d origin, Vec3d direction) { return round_ray(&origin.x, &direction.x); }

constexpr RoundBall kFirst{{0, 0, 0}, 1}, kLast{{4, 0, 2}, 0.5};

TEST(RibbonSegment, IsMetAtTheDepthOfItsAxis) {
  const Chord chord = chord_of_ribbon(ray_of({2, 0.7, 10}, {0, 0, -2}), kFirst, kLast, 0);
  EXPECT_DOUBLE_EQ(chord.entry, 4.5);
  EXPECT_EQ(chord.entry, chord.exit);
  EXPECT_FALSE(is_hit(chord_of_ribbon(ray_of({2, 0.76, 10}, {0, 0, -2}), kFirst, kLast, 0)));
}

TEST(RibbonSegment, IsCutOffWhereTheCurveEnds) {
  const RoundRay before = ray_of({-0.1, 0, 10}, {0, 0, -1}), beyond = ray_of({4.1, 0, 10}, {0, 0, -1});
  EXPECT_FALSE(is_hit(chord_of_ribbon(before, kFirst, kLast, kSegmentAfter)));
  EXPECT_FALSE(is_hit(chord_of_ribbon(beyond, kFirst, kLast, kSegmentBefore)));
  EXPECT_EQ(chord_of_ribbon(before, kFirst, kLast, kSegmentBefore).entry, 10);
  EXPECT_EQ(chord_of_ribbon(beyond, kFirst, kLast, kSegmentAfter).entry, 8);
}

TEST(RibbonSegment, IsMetAtTheNearerEndAlongTheAxis) {
  const RoundBall first{{0, 0, 0}, 1}, last{{0, 0, 3}, 1};
  EXPECT_EQ(chord_of_ribbon(ray_of({0.5, 0, 10}, {0, 0, -1}), first, last, 0).entry, 7);
  EXPECT_EQ(chord_of_ribbon(ray_of({0.5, 0, -10}, {0, 0, 1}), first, last, 0).entry, 10);
}

TEST(RibbonSegment, OneOfTwoIsShown) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> any(-1, 1);
  std::size_t met = 0;
  for (int i = 0; i < 20000; ++i) {
    std::vector<Ball> balls(3);
    for (Ball& ball : balls) ball = {{any(random), any(random), any(random)}, 0.5f};
    const std::vector<SegmentCode> segments{0u | kSegmentAfter, 1u | kSegmentBefore};
    const RoundList list{balls.data(), segments.data(), 1.0f, CurveShape::kRibbon};
    const Vec3d joint = to_double(balls[1].centre);
    const Vec3d direction{static_cast<double>(any(random)), static_cast<double>(any(random)), 1.0};
    const Vec3d aside{0.1 * static_cast<double>(any(random)), 0.1 * static_cast<double>(any(random)), 0};
    const RoundRay ray = ray_of(joint + aside - direction * 1000.0, direction);
    int shown = 0;
    for (const std::uint32_t primitive : {0u, 1u}) {
      const Chord chord = chord_of(ray, list, primitive);
      if (!is_hit(chord)) continue;
      const ShownEnds ends = shown_ends(ray, list, primitive, chord);
      EXPECT_FALSE(ends.exit);
      shown += ends.entry ? 1 : 0;
    }
    EXPECT_LE(shown, 1);
    met += static_cast<std::size_t>(shown);
  }
  // All except those that come nearest to the curve's own ends.
  EXPECT_GT(met, 19000u);
}

TEST(RibbonSegment, NormalsTurnFromTheRayToTheSide) {
  const double direction[3] = {0, 0, -2}, tangent[3] = {3, 0, 0}, side[3] = {0, 0.1, 0};
  double normal[3];
  for (const double share : {0.0, 0.5, 1.0, 1.5}) {
    ribbon_normal(direction, tangent, side, share, normal);
    const double sine = std::fmin(share, 1.0);
    EXPECT_NEAR(normal[0], 0, 1e-15);
    EXPECT_NEAR(normal[1], sine, 1e-15);
    EXPECT_NEAR(normal[2], std::sqrt(1 - sine * sine), 1e-15);
  }
}

TEST(RibbonSegment, NormalsFaceWhatComesAlongTheCurve) {
  const double direction[3] = {0, 0, -2}, tangent[3] = {0, 0, 1}, side[3] = {0, 0.1, 0};
  double normal[3];
  ribbon_normal(direction, tangent, side, 0.5, normal);
  EXPECT_EQ(normal[2], 1);
}

}  // namespace
}  // namespace perfect_bvh
