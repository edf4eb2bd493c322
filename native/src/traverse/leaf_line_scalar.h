// A ray's line in a leaf's steps, in plain C++.
// Included by translation units of kernels only; everything in it has internal linkage.
#pragma once

#include "math/round_segment.h"
#include "traverse/leaf_line.h"
#include "traverse/object_ray.h"

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

}  // namespace
}  // namespace perfect_bvh
