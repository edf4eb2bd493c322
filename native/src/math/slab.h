// The slab test: does a ray pass through a box, and from which t to which?
// Boxes are widened so that no hit inside them is lost to rounding (after Ize 2013, but widening by position instead
// of by t). For axis k with |box| <= M_k: the subtraction, the product and the narrowing of the ray to float move a
// plane by less than 6 * 2^-24 * (M_k + |o_k|); the planes are moved outward by that before they are tested.
//
// Every operation is monotone in the box's planes: a box inside another one gets a range inside the other's range,
// exactly, in floating point. The kernels rest on this: a triangle's t is clamped to the range of the triangle's own
// box, so that no ancestor's box can be pruned before it, whatever tree it is in.
#pragma once

#include <cmath>
#include <limits>

#include "math/aabb.h"

namespace perfect_bvh {

struct SlabRange {
  float near, far;
};

struct SlabRay {
  Vec3f near_origin, far_origin;  // the origin, moved so that near planes come earlier and far planes later
  Vec3f inverse;                  // 1 / direction; infinite for an axis the ray is parallel to
  bool negative[3];

  SlabRay(Vec3f origin, Vec3f direction, const Aabb& bounds) noexcept {
    constexpr float kWidening = 6.0f * 0x1p-24f;
    for (int axis = 0; axis < 3; ++axis) {
      const float largest = std::max(std::abs(bounds.lower[axis]), std::abs(bounds.upper[axis]));
      const float margin = kWidening * (largest + std::abs(origin[axis]));
      negative[axis] = std::signbit(direction[axis]);
      near_origin[axis] = negative[axis] ? origin[axis] - margin : origin[axis] + margin;
      far_origin[axis] = negative[axis] ? origin[axis] + margin : origin[axis] - margin;
      inverse[axis] = 1.0f / direction[axis];  // signed zero gives the infinity that `negative` expects
    }
  }

  // The range of t inside the box, intersected with [t_min, t_max]; empty (near > far) if the ray misses it.
  // 0 * inf (origin exactly on the moved plane, ray parallel to it) is NaN, fails every comparison, and so leaves
  // the range as it was: the plane counts as inside.
  [[nodiscard]] SlabRange range(Vec3f lower, Vec3f upper, float t_min, float t_max) const noexcept {
    float near = t_min, far = t_max;
    for (int axis = 0; axis < 3; ++axis) {
      const float first = negative[axis] ? upper[axis] : lower[axis];
      const float last = negative[axis] ? lower[axis] : upper[axis];
      const float enter = (first - near_origin[axis]) * inverse[axis];
      const float leave = (last - far_origin[axis]) * inverse[axis];
      near = enter > near ? enter : near;
      far = leave < far ? leave : far;
    }
    return {near, far};
  }
};

}  // namespace perfect_bvh
