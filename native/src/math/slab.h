// The slab test (traverse/node_test.inl): does a ray pass through a box, and from which t to which? Its constants, and
// the bounds that make it lose no hit.
//
// What rounding does, in one mesh's frame. u = 2^-24; k is the direction's longest axis, a any axis, s = d_a / d_k,
// R_a = (largest |coordinate| on a) + |o_a|. The triangle test (math/triangle.h) shears the vertices: x = v_a - o_a,
// z = v_k - o_k, x' = x - S z with S = d_a * (1 / d_k). Two subtractions, S off by 2 u, one fused operation:
//   |x' computed - x' exact| <= u (2 R_a + 4 |s| R_k).
// Its edge functions U_i of the computed x', y' have the right sign and lie within 2 u of their value. Let
// w_i = U_i / sum U: they are >= 0 and sum to 1, so P = sum w_i v_i lies in the triangle, exactly. With exact U_i,
// sum U_i x'_i would be 0; so |sum w_i x'_i| <= 2 u (R_a + |s| R_k) + the bound above. The computed t is
// sum w_i z_i / d_k within 8 u R_k / |d_k| (z: 1, accumulation: 3, sum of the U: 2, product: 1, division: 1). Together:
//   |o_a + t d_a - P_a| <= u (4 R_a + 14 |s| R_k).
// No determinant appears in it: however thin the triangle and however grazing the ray, that t is where the ray is
// within a few roundings of a point P of that very triangle. Call it the weighted t.
// The t of a hit is that of the triangle's plane, rounded to float, if the ray's point there lies in the triangle: then
// P is that point, and the roundings of t and of the ray to float come to u (R_a / |d_a| + 2 R_k / |d_k|). Else it is
// the weighted t. The slab test's own roundings (near = plane * inv - fl(o * inv + e), one fused operation) come to 4 u
// R_a / |d_a|, those of the best t to u R_k / |d_k|. With
//   e_a >= u (8 R_a / |d_a| + 15 R_k / |d_k|)
// near <= t <= far holds, in floating point, for every box that contains P; and, the operations being monotone in the
// planes, for every box around that one. P lies in the boxes of all nodes above the triangle, or, if references were
// split, of those above one of its leaves. So strict pruning (near > best t) loses no hit, and no tree decides
// between two hits.
// A component below 2^-40 of the longest is raised to that before it is inverted. Over the whole reach of the ray
// that moves it by 2^-39 R_k at most, for which 2^-18 R_k is added to R_a. So zeros of either sign need no further
// care, and neither infinity nor NaN arises.
#pragma once

#include "math/vec3.h"

namespace perfect_bvh {

// The largest |coordinate| of a tree's boxes on each axis, and the largest of the three.
struct TreeExtent {
  float largest[3];
  float reach;
};

// The bounds above, rounded up for the roundings of e itself.
inline constexpr float kPlaneSlack = 9.0f * 0x1p-24f;
inline constexpr float kDepthSlack = 16.0f * 0x1p-24f;
inline constexpr float kSmallestShare = 0x1p-40f;
inline constexpr float kReachShare = 0x1p-18f;

// t of a plane = plane * inverse - offset, in one fused operation.
struct SlabRay {
  float inverse[3];
  float near_offset[3], far_offset[3];
};

// Twice what the weighted t may be from the depths of a triangle's corners.
inline constexpr float kDepthReach = 16.0f * 0x1p-24f;
// The sheared corners are within 10 u R of where they are, on each axis and with the ray's narrowing, R at most 5 times
// the tree's reach. In the sheared frame lengths are at most twice as long. So what is this many reaches inside an
// edge, times the edge's length before, is inside of it without any rounding.
inline constexpr float kEdgeReach = 160.0f * 0x1p-24f;

// Kernels compiled for several instruction sets include this file: nothing in it may have external linkage.
static inline float magnitude(float x) noexcept { return __builtin_fabsf(x); }
static inline float larger(float a, float b) noexcept { return a > b ? a : b; }
static inline float smaller(float a, float b) noexcept { return a < b ? a : b; }

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
