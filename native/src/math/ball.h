// What curves and points are made of: a point is a ball, and a curve's segment the convex hull of two.
#pragma once

#include <cstdint>

#include "math/aabb.h"
#include "math/vec3.h"

namespace perfect_bvh {

struct alignas(16) Ball {
  Vec3f centre;
  float radius;  // not negative
};
static_assert(sizeof(Ball) == 16);

// Contains the ball. With u = 2^-24 a sum s of two floats is within u |s| of the exact one, and exact if it is
// subnormal. s 2^-23 is at least the distance from s to the float beside it, and s shifted by that is rounded no
// nearer than that float.
[[nodiscard]] static inline Aabb box_of(const Ball& ball) noexcept {
  Aabb box;
  for (int axis = 0; axis < 3; ++axis) {
    const float lower = ball.centre[axis] - ball.radius, upper = ball.centre[axis] + ball.radius;
    box.lower[axis] = lower - (lower < 0.0f ? -lower : lower) * 0x1p-23f;
    box.upper[axis] = upper + (upper < 0.0f ? -upper : upper) * 0x1p-23f;
  }
  return box;
}

// A curve's segment: the number of its first ball, the other being the next one, and whether the same curve has another
// segment after it, with the next number, or before it.
using SegmentCode = std::uint32_t;
inline constexpr SegmentCode kSegmentBall = 0x3FFFFFFFu, kSegmentAfter = 0x40000000u, kSegmentBefore = 0x80000000u;

// A cyclic curve's first and last segment, which are each other's neighbours.
struct ClosedCurve {
  std::uint32_t first, last;
};

// What curves are to rays: the hull of their balls, or flat and always turned to the ray (math/ribbon_segment.h).
enum class CurveShape : std::uint8_t { kRound, kRibbon };

}  // namespace perfect_bvh
