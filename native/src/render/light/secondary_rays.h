// Rays that leave a surface, towards lights, the environment and other surfaces; and of those towards lights how much
// gets through what is in their way: all of it, nothing, or what transparent surfaces let through.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/aligned.h"
#include "core/cancel.h"
#include "query/round_surface.h"
#include "query/trace.h"
#include "render/appearance/appearance.h"
#include "render/surface/surface.h"
#include "tlas/snapshot.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// Whether a direction leads to the side of the surface that the viewer does not see.
[[nodiscard]] inline bool leads_beyond(const SurfacePoint& point, Vec3f direction) noexcept {
  return dot(direction, point.light_normal) < 0.0f;
}

// Directions round a smooth normal may dip below the triangle. From a point lifted off it they pass over its
// neighbours; from the triangle itself they would end in it, and are mirrored.
[[nodiscard]] inline Vec3f above(const SurfacePoint& point, Vec3f direction) noexcept {
  const float height = dot(direction, point.geometric_normal);
  if (height >= 0.0f || !(point.lift == Vec3f{0, 0, 0}) || leads_beyond(point, direction)) return direction;
  return direction - point.geometric_normal * (2.0f * height);
}

[[nodiscard]] inline Ray ray_from(const SurfacePoint& point, Vec3f direction, float reach,
                                  std::uint32_t mask) noexcept {
  Ray ray;
  ray.direction = to_double(direction);
  ray.origin = leads_beyond(point, direction) ? point.beyond : point.origin;
  if (point.strand != nullptr && leads_beyond(point, direction)) {
    ray.origin = leave_curve(*point.strand, point.segment, ray.origin, ray.direction, point.time);
  }
  ray.t_max = reach;
  ray.mask = mask;
  ray.time = point.time;
  return ray;
}

// The same towards a light. Where that is low over a coarse mesh's triangle, the neighbours are in the way that the
// curved surface would not have: there, as in Cycles, the ray starts on that surface.
[[nodiscard]] inline Ray shadow_ray(const SurfacePoint& point, Vec3f direction, float reach,
                                    std::uint32_t mask) noexcept {
  Ray ray = ray_from(point, direction, reach, mask);
  if (leads_beyond(point, direction)) return ray;
  constexpr float kLow = 0.1f;  // a cosine; up to twice that it fades
  const float over_curve = dot(direction, point.light_normal) / kLow;
  const float over_triangle = dot(direction, point.geometric_normal) / kLow;
  const float share = std::clamp(1.0f - over_triangle + std::max(1.0f - over_curve, 0.0f), 0.0f, 1.0f);
  ray.origin = ray.origin + to_double(point.lift * share);
  return ray;
}

// Buffers of one thread; a row a ray.
struct ShadowRays {
  AlignedVector<Ray> rays;
  AlignedVector<std::uint32_t> vertices;  // the row of the vertex that a ray belongs to
  AlignedVector<Vec3f> carried;           // what it adds to the image if nothing is in its way
  AlignedVector<float> passed;
  AlignedVector<Hit> hits;
  AlignedVector<std::uint8_t> blocked;

  void clear() noexcept { rays.clear(), vertices.clear(), carried.clear(); }
  void add(const Ray& ray, std::uint32_t vertex, Vec3f light) {
    rays.push_back(ray), vertices.push_back(vertex), carried.push_back(light);
  }
};

// Fills `passed`. Spoils the rays.
// most_layers: of transparent surfaces that a ray passes; what is behind them is dark.
void find_what_passes(const Snapshot& snapshot, const Appearance& appearance, int most_layers, CancelToken& cancel,
                      ShadowRays& shadows);

}  // namespace perfect_bvh
