// The slab test (traverse/leaf_test.inl) decides whether a ray passes through a box, and from which t to which. This
// file has its constants, and the bounds that make it lose no hit.
//
// Rounding errors, in one mesh's frame. u = 2^-24; k is the direction's longest axis, a any axis, R_a = (largest
// |coordinate| on a) + |o_a|. The triangle test (math/triangle.h) finds t and decides in double: the ray's point at t
// is a point P of the triangle, up to rounding errors that are negligible in float. The errors of float remain. t is
// rounded (u R_k / |d_k|). The slab test uses the narrowed ray (u R_a / |d_a| for its origin, u R_k / |d_k| for its
// direction), rounds itself (near = plane * inv - fl(o * inv + e), one fused operation: 4 u R_a / |d_a|), and compares
// with a best t that was converted to this frame (2 u R_k / |d_k|). With
//   e_a >= u (5 R_a / |d_a| + 4 R_k / |d_k|)
// near <= t <= far holds, in floating point, for every box that contains P. As the operations are monotone in the
// planes, it also holds for every box around that one. P is in the boxes of all nodes above the triangle, or, if
// references were split, of those above one of its leaves. So strict pruning (near > best t) loses no hit, and the tree
// never decides between two hits.
// A component below 2^-40 of the longest is raised to that, keeping its sign, before it is inverted. Over the whole
// reach of the ray this moves it by at most 2^-40 R_k, for which 2^-18 R_k is added to R_a: 6 u of it are half as much
// again. So zeros of either sign need no special case, and no infinity or NaN arises.
#pragma once

#include "math/vec3.h"

namespace perfect_bvh {

// The largest |coordinate| of a tree's boxes on each axis, and the largest of the three.
struct TreeExtent {
  float largest[3];
  float reach;
};

// The bounds above, rounded up for the rounding of e itself.
inline constexpr float kPlaneSlack = 6.0f * 0x1p-24f;
inline constexpr float kDepthSlack = 5.0f * 0x1p-24f;
inline constexpr float kSmallestShare = 0x1p-40f;
inline constexpr float kReachShare = 0x1p-18f;

// t of a plane = plane * inverse - offset, in one fused operation.
struct SlabRay {
  float inverse[3];
  float near_offset[3], far_offset[3];
};

// How far t, and the value that it is compared with, may be from the depths of a triangle's corners in float: each is
// off by 4 u R_k / |d_k|.
inline constexpr float kDepthReach = 8.0f * 0x1p-24f;
// With R the largest R_a, the sheared corners are off by at most 10 u R on each axis, and by 14.2 u R including the
// ray's narrowing. Lengths in the sheared frame are at most 1.74 times as long. So if the origin is kEdgeReach times R
// away from an edge, times the edge's length before shearing, its side is the same as without any rounding
// (weight_slack() in math/triangle.h also covers edges shorter than that).
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

// The direction's longest component must be a normal number between 2^-20 and 2^21.
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
