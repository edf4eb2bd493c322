// Tracing a batch of rays through a snapshot on the calling thread. Callers split large batches over threads; the
// answers depend on neither the split nor the order of the rays.
// In: rays in world space. Out: one row a ray, always; invalid rays are misses.
#pragma once

#include <span>

#include "core/cancel.h"
#include "math/vec3.h"
#include "stats/ray_counts.h"
#include "tlas/snapshot.h"
#include "traverse/ray.h"
#include "traverse/strategy.h"

namespace perfect_bvh {

// `counts` is empty, or has a row a ray. Both return how many rays went in packets.
// `cancel` is asked every so many steps (see Interruption). Throws Cancelled.
std::size_t trace_closest(const Snapshot& snapshot, CancelToken& cancel, std::span<const Ray> rays, std::span<Hit> hits,
                          Cull cull = Cull::kNone, std::span<RayCounts> counts = {},
                          Strategy strategy = Strategy::kAuto);
// occluded[i] = 1 if anything lies within the ray's range.
std::size_t trace_occluded(const Snapshot& snapshot, CancelToken& cancel, std::span<const Ray> rays,
                           std::span<std::uint8_t> occluded, Cull cull = Cull::kNone, std::span<RayCounts> counts = {},
                           Strategy strategy = Strategy::kAuto);

// The same without cancellation.
inline std::size_t trace_closest(const Snapshot& snapshot, std::span<const Ray> rays, std::span<Hit> hits,
                                 Cull cull = Cull::kNone, std::span<RayCounts> counts = {},
                                 Strategy strategy = Strategy::kAuto) {
  CancelToken never;
  return trace_closest(snapshot, never, rays, hits, cull, counts, strategy);
}
inline std::size_t trace_occluded(const Snapshot& snapshot, std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                                  Cull cull = Cull::kNone, std::span<RayCounts> counts = {},
                                  Strategy strategy = Strategy::kAuto) {
  CancelToken never;
  return trace_occluded(snapshot, never, rays, occluded, cull, counts, strategy);
}

// A triangle's corners in world space, in winding order.
struct WorldTriangle {
  Vec3d v0, v1, v2;

  // Following the world winding (so not turned towards the ray), as long as twice the area.
  [[nodiscard]] Vec3d scaled_normal() const noexcept { return cross(v1 - v0, v2 - v0); }
  // The place that the hit's u and v name.
  [[nodiscard]] Vec3d at(const Hit& hit) const noexcept {
    const auto u = static_cast<double>(hit.u), v = static_cast<double>(hit.v);
    return v0 * (1.0 - u - v) + v1 * u + v2 * v;
  }
};
// time: of an instance that moves within the shutter.
[[nodiscard]] WorldTriangle place_moving_triangle(const Instance& instance, TriangleIndices corners,
                                                  float time) noexcept;
[[nodiscard]] inline WorldTriangle place_triangle(const Instance& instance, TriangleIndices corners,
                                                  float time = 0.0f) noexcept {
  if (instance.motion != 0) return place_moving_triangle(instance, corners, time);
  const auto place = [&](std::uint32_t vertex) {
    return instance.object_to_world.point(to_double(instance.blas->mesh.positions[vertex]));
  };
  return {place(corners.x), place(corners.y), place(corners.z)};
}
[[nodiscard]] WorldTriangle world_triangle(const Snapshot& snapshot, const Hit& hit, float time = 0.0f) noexcept;
// The point on the triangle, from u and v.
[[nodiscard]] Vec3d hit_position(const Snapshot& snapshot, const Hit& hit, float time = 0.0f) noexcept;
// Where the ray meets the plane of the triangle that it hits, in double: on a plane of kilometres u and v, which are
// floats, are millimetres beside it. From u and v where the plane says no more: for triangles that are seen edge-on, or
// some million times as long as wide, or as far away as they are long.
[[nodiscard]] Vec3d ray_position(const Instance& instance, TriangleIndices corners, const Hit& hit,
                                 const Ray& ray) noexcept;

}  // namespace perfect_bvh
