// From a ray in double to the constants of its level, in plain C++. The vector version gives the same bits.
// Included by translation units of kernels only; everything in it has internal linkage.
#pragma once

#include "traverse/ray_state.h"

namespace perfect_bvh {
namespace {

// The ray times `scale`. False if its origin is not finite (directions are checked later, by bring_near).
inline bool load_ray(ObjectRay& out, const Ray& ray, double scale) noexcept {
  const double* const origin = &ray.origin.x;
  const double* const direction = &ray.direction.x;
  bool is_finite = true;
  for (int axis = 0; axis < 3; ++axis) {
    is_finite = is_finite && origin[axis] - origin[axis] == 0.0;
    out.origin[axis] = origin[axis] * scale;
    out.direction[axis] = direction[axis] * scale;
  }
  out.origin[3] = out.direction[3] = 0.0;
  out.time = {0.0, 1.0, true};
  return is_finite;
}

inline bool load_near(ObjectRay& out, const Ray& ray, double scale, double farthest) noexcept {
  return load_near_by_axis(out, ray, scale, farthest);
}

inline void map_to_local(ObjectRay& out, const ObjectRay& ray, const MapColumns& map) noexcept {
  map_ray(out, ray, map);
}
inline bool stands_near(const ObjectRay& ray, double reach) noexcept { return is_near(ray, reach); }

// All but the limits of t. The ray is near.
inline void set_states(BoxState& box, TriangleState& triangle, const ObjectRay& ray,
                       const TreeExtent& extent) noexcept {
  float origin[3], direction[3];
  narrow(ray.origin, origin);
  narrow(ray.direction, direction);
  const int longest = longest_axis(direction);
  set_slab_ray(box.slab, origin, direction, longest, extent);
  std::uint32_t octant = 0;
  for (int axis = 0; axis < 3; ++axis) octant |= (box.slab.inverse[axis] < 0.0f ? 1u : 0u) << axis;
  box.rows = kOctantRows[octant];
  set_triangle_ray(triangle.ray, origin, direction, longest, extent);
  for (int i = 0; i < 3; ++i) triangle.row[i] = static_cast<std::uint16_t>(32 * triangle.ray.axes[i]);
}

}  // namespace
}  // namespace perfect_bvh
