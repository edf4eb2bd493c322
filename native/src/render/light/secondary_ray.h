// Rays that leave a surface: towards lights, the environment and other surfaces.
#pragma once

#include "render/surface/surface.h"

namespace perfect_bvh {

// Whether a direction leads to the side of the surface that the viewer does not see.
[[nodiscard]] inline bool leads_beyond(const SurfacePoint& point, Vec3f direction) noexcept {
  return dot(direction, point.light_normal) < 0.0f;
}

// Directions round a smooth normal may dip below the triangle. From a point lifted off it they pass over its
// neighbours; from the triangle itself they would end in it, and are mirrored.
[[nodiscard]] inline Vec3f above(const SurfacePoint& point, Vec3f direction) noexcept {
  const float height = dot(direction, point.geometric_normal);
  if (height >= 0.0f || point.lifted || leads_beyond(point, direction)) return direction;
  return direction - point.geometric_normal * (2.0f * height);
}

[[nodiscard]] inline Ray ray_from(const SurfacePoint& point, Vec3f direction, float reach,
                                  std::uint32_t mask) noexcept {
  Ray ray;
  ray.origin = leads_beyond(point, direction) ? point.beyond : point.origin;
  ray.direction = to_double(direction);
  ray.t_max = reach;
  ray.mask = mask;
  return ray;
}

}  // namespace perfect_bvh
