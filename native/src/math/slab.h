// The slab test (traverse/leaf_test.inl): does a ray pass through a box, and from which t to which? Its constants, and
// the bounds that make it lose no hit.
//
// What rounding does, in one mesh's frame. u = 2^-24; k is the direction's longest axis, a any axis,
// R_a = (largest |coordinate| on a) + |o_a|. The triangle test (math/triangle.h) finds t and decides in double: the
// ray's point at t is a point P of the triangle, but for roundings that are nothing beside float's. What is left is
// float's: t is rounded (u R_k / |d_k|), and the slab test knows the ray as it was narrowed (u R_a / |d_a| its origin,
// u R_k / |d_k| its direction), rounds on its own (near = plane * inv - fl(o * inv + e), one fused operation:
// 4 u R_a / |d_a|), and compares with a best t that was brought to this frame (2 u R_k / |d_k|). With
//   e_a >= u (5 R_a / |d_a| + 4 R_k / |d_k|)
// near <= t <= far holds, in floating point, for every box that contains P; and, the operations being monotone in the
// planes, for every box around that one. P lies in the boxes of all nodes above the triangle, or, if references were
// split, of those above one of its leaves. So strict pruning (near > best t) loses no hit, and no tree decides
// between two hits.
// A component below 2^-40 of the longest is raised to that, its sign kept, before it is inverted. Over the whole reach
// of the ray that moves it by 2^-40 R_k at most, for which 2^-18 R_k is added to R_a: 6 u of it are half as much again.
// So zeros of either sign need no further care, and neither infinity nor NaN arises.
#pragma once

#include "math/vec3.h"

namespace perfect_bvh {

// The largest |coordinate| of a tree's boxes on each axis, and the largest of the three.
struct TreeExtent {
  float largest[3];
  float reach;
};

// The bounds above, rounded up for the roundings of e itself.
inline constexpr float kPlaneSlack = 6.0f * 0x1p-24f;
inline constexpr float kDepthSlack = 5.0f * 0x1p-24f;
inline constexpr float kSmallestShare = 0x1p-40f;
inline constexpr float kReachShare = 0x1p-18f;

// t of a plane = plane * inverse - offset, in one fused operation.
struct SlabRay {
  float inverse[3];
  float near_offset[3], far_offset[3];
};

// How far t, and what it is compared with, may be from the depths of a triangle's corners in float: each is off by
// 4 u R_k / |d_k|.
inline constexpr float kDepthReach = 8.0f * 0x1p-24f;
// With R the largest R_a, the sheared corners are within 10 u R of where they are, on each axis and with the ray's
// narrowing: within 14.2 u R. In the sheared frame lengths are at most 1.74 times as long. So on which side of an edge
// the origin lies at so many R, times the edge's length before, is as it is without any rounding (weight_slack() in
// math/triangle.h: for edges that are shorter than that, too).
inline constexpr float kEdgeReach = 28.0f * 0x1p-24f;

// Kernels compiled for several instruction sets include this file: nothing in it may have external linkage.
static inline float magnitude(float x) noexcept { return __builtin_fabsf(x); }
template <class Real>
static inline Real larger(Real a, Real b) noexcept {
  return a > b ? a : b;
}
template <class Real>
static inline Real smaller(Real a, Real b) noexcept {
  return a < b ? a : b;
}

static inline int longest_axis(const float direction[3]) noexcept {
  const float x = magnitude(direction[0]), y = magnitude(direction[1]), z = magnitude(direction[2]);
  const int longer = x > y ? 0 : 1;
  return larger(x, y) > z ? longer : 2;
}

// The direction's longest component must be a normal number within 2^-20 and 2^21.
static inline void set_slab_ray(SlabRay& ray, const float origin[3], const float direction[3], int longest,
                                const TreeExtent& extent) noexcept {
  const float length = magnitude(direction[longest]);
  const float smallest = kSmallestShare * length;
  const float long_reach = extent.largest[longest] + magnitude(origin[longest]);
  const float depth_slack = kDepthSlack * (long_reach * (1.0f / length));
  for (int axis = 0; axis < 3; ++axis) {
    const float raised = __builtin_copysignf(larger(magnitude(direction[axis]), smallest), direction[axis]);
    const float inverse = 1.0f / raised;
    const float reach = extent.largest[axis] + magnitude(origin[axis]) + kReachShare * long_reach;
    const float slack = kPlaneSlack * (reach * magnitude(inverse)) + depth_slack;
    const float at_origin = origin[axis] * inverse;
    ray.inverse[axis] = inverse;
    ray.near_offset[axis] = at_origin + slack;
    ray.far_offset[axis] = at_origin - slack;
  }
}

}  // namespace perfect_bvh
