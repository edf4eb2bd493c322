// The constants of a ray at one level, as kernels keep them.
#pragma once

#include <cstdint>

#include "math/slab.h"
#include "math/triangle.h"
#include "traverse/object_ray.h"

namespace perfect_bvh {

// By the octant of a ray (bit a: it runs down axis a): where the planes it meets first and last stand in a node, in
// bytes, and 3 * octant.
struct OctantRows {
  std::uint16_t near_row[3], far_row[3];
  std::uint32_t order_shift;
};

// What node visits read.
struct BoxState {
  SlabRay slab;
  OctantRows rows;
  float t_min, t_limit;  // local; the limit sinks as hits are found
};
static_assert(sizeof(BoxState) == 60);

// What leaf visits read.
struct TriangleState {
  TriangleRay ray;
  std::uint16_t row[4];  // byte offsets in a leaf block of the sheared frame's x, y and z
  // Along the sheared z: between these depths a triangle must have a point to be met within the limits of t.
  float least_depth, largest_depth;
};

// As much is added as a hit's t may be beyond the depths of the triangle's corners.
static inline void set_depths(TriangleState& triangle, float t_min, float t_limit) noexcept {
  const TriangleRay& ray = triangle.ray;
  const float slack = ray.depth_slack;
  const float first = (t_min - slack) * ray.direction_z, last = (t_limit + slack) * ray.direction_z;
  triangle.least_depth = ray.runs_down ? last : first;
  triangle.largest_depth = ray.runs_down ? first : last;
}

static constexpr OctantRows octant_rows(std::uint32_t octant) noexcept {
  OctantRows rows{};
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    const std::uint32_t runs_down = octant >> axis & 1;
    rows.near_row[axis] = static_cast<std::uint16_t>(64 * axis + 32 * runs_down);
    rows.far_row[axis] = static_cast<std::uint16_t>(64 * axis + 32 - 32 * runs_down);
  }
  rows.order_shift = 3 * octant;
  return rows;
}
static constexpr OctantRows kOctantRows[8] = {octant_rows(0), octant_rows(1), octant_rows(2), octant_rows(3),
                                              octant_rows(4), octant_rows(5), octant_rows(6), octant_rows(7)};

}  // namespace perfect_bvh
