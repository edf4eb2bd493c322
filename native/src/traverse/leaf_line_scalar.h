// Converts a ray's line to a leaf's steps, in plain C++.
// Included by translation units of kernels only; everything in it has internal linkage.
#pragma once

#include "math/round_segment.h"
#include "math/triangle.h"
#include "traverse/ray.h"
#include "traverse/scene_view.h"

namespace perfect_bvh {
namespace {

// `slack`: in units of the tree.
inline LeafLine leaf_line(const LeafCorner& corner, const ObjectRay& ray, float t_min, float t_limit,
                          float slack) noexcept {
  LeafLine line;
  const double steps = static_cast<double>(corner.steps);
  double to_corner[3], nearest[3];
  for (int axis = 0; axis < 3; ++axis) to_corner[axis] = static_cast<double>(corner.at[axis]) - ray.origin[axis];
  const double squared = dot_of(ray.direction, ray.direction), t = dot_of(to_corner, ray.direction) / squared;
  for (int axis = 0; axis < 3; ++axis) {
    nearest[axis] = fused(t, ray.direction[axis], -to_corner[axis]) * steps;
    line.nearest[axis] = static_cast<float>(nearest[axis]);
    line.direction[axis] = static_cast<float>(ray.direction[axis]);
  }
  line.nearest[3] = line.direction[3] = 0.0f;
  const double first = static_cast<double>(t_min), last = static_cast<double>(t_limit), to_depth = squared * steps;
  line.least = static_cast<float>(((first - t) - 0x1p-22 * __builtin_fabs(first)) * to_depth);
  line.most = static_cast<float>(((last - t) + 0x1p-22 * __builtin_fabs(last)) * to_depth);
  line.away = static_cast<float>(largest_component(nearest));
  line.squared_length = static_cast<float>(squared);
  line.length = __builtin_sqrtf(line.squared_length);
  line.slack = slack * corner.steps;
  return line;
}

// Plane scalar --------------------------------------------------------------------------------------------------------
// Computes t of one triangle's plane in plain C++. The vector version gives the same t, bit for bit.
// Included by translation units of kernels only; everything in it has internal linkage.

// `at(corner, axis)` returns a coordinate of a corner.
template <class Corners>
inline double meet_plane(const Corners& at, const double* origin, const double* direction) noexcept {
  const float a[3] = {at(0, 0), at(0, 1), at(0, 2)};
  const float b[3] = {at(1, 0), at(1, 1), at(1, 2)};
  const float c[3] = {at(2, 0), at(2, 1), at(2, 2)};
  return plane_t(plane_of(a, b, c), origin, direction);
}

}  // namespace

}  // namespace perfect_bvh
