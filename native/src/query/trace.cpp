#include "query/trace.h"

#include <algorithm>
#include <cmath>

#include "tlas/trace_view.h"
#include "traverse/dispatch.h"

namespace perfect_bvh {
namespace {

Vec3d absolute(Vec3d a) noexcept { return {std::abs(a.x), std::abs(a.y), std::abs(a.z)}; }
double largest(Vec3d a) noexcept { return std::max({std::abs(a.x), std::abs(a.y), std::abs(a.z)}); }

// A vector of an instance in world space.
struct Placed {
  Placed(const Affine& map, Vec3d v) noexcept
      : vector(map.vector(v)),
        size(largest(absolute(map.x) * std::abs(v.x) + absolute(map.y) * std::abs(v.y) +
                     absolute(map.z) * std::abs(v.z))) {}

  Vec3d vector;
  double size;  // the largest sum of its terms' sizes: what its rounding goes with
};

}  // namespace

std::size_t trace_closest(const Snapshot& snapshot, CancelToken& cancel, std::span<const Ray> rays, std::span<Hit> hits,
                          Cull cull, std::span<RayCounts> counts, Strategy strategy) {
  const RayBatch batch{rays.data(), rays.size(), cull, counts.empty() ? nullptr : counts.data(), hits.data(), nullptr};
  std::size_t in_packets = 0;
  with_view(snapshot, cancel,
            [&](const SceneView& view) { in_packets = trace_closest(view, batch, TraceOptions{strategy}); });
  count_rays(snapshot, rays.size());
  return in_packets;
}

std::size_t trace_occluded(const Snapshot& snapshot, CancelToken& cancel, std::span<const Ray> rays,
                           std::span<std::uint8_t> occluded, Cull cull, std::span<RayCounts> counts,
                           Strategy strategy) {
  const RayBatch batch{rays.data(), rays.size(),    cull, counts.empty() ? nullptr : counts.data(),
                       nullptr,     occluded.data()};
  std::size_t in_packets = 0;
  with_view(snapshot, cancel,
            [&](const SceneView& view) { in_packets = trace_any(view, batch, TraceOptions{strategy}); });
  count_rays(snapshot, rays.size());
  return in_packets;
}

WorldTriangle place_moving_triangle(const Instance& instance, TriangleIndices corners, float time) noexcept {
  const Affine map = place_at(instance, time);
  const Moment moment = moment_of(instance, time);
  const auto place = [&](std::uint32_t vertex) {
    return map.point(to_double(instance.blas->mesh.position_at(vertex, moment)));
  };
  return {place(corners.x), place(corners.y), place(corners.z)};
}

WorldTriangle world_triangle(const Snapshot& snapshot, const Hit& hit, float time) noexcept {
  const Instance& instance = snapshot.instances[hit.instance_index];
  return place_triangle(instance, instance.blas->mesh.triangles[hit.primitive_index], time);
}

Vec3d hit_position(const Snapshot& snapshot, const Hit& hit, float time) noexcept {
  return world_triangle(snapshot, hit, time).at(hit);
}

Vec3d ray_position(const Instance& instance, TriangleIndices corners, const Hit& hit, const Ray& ray) noexcept {
  const Mesh& mesh = instance.blas->mesh;
  const Affine place = place_at(instance, ray.time);
  const Moment moment = moment_of(instance, ray.time);
  const auto position = [&](std::uint32_t vertex) { return to_double(mesh.position_at(vertex, moment)); };
  const Vec3d d = ray.direction, p0 = position(corners.x);
  const Placed edge1(place, position(corners.y) - p0), edge2(place, position(corners.z) - p0);
  const Placed corner(place, p0);
  const Vec3d normal = cross(edge1.vector, edge2.vector), arm = corner.vector + (place.translation - ray.origin);
  const double slope = dot(normal, d), t = dot(normal, arm) / slope;
  // With e = 2^-53: edges are off by 4 e of their terms' sizes, so that each component of the normal is off by at most
  // 20 e times the product of both, the products by 5 e of their terms' sizes, and the corner by 4 e of its terms'. So
  // t is off by at most 2^7 e of this, divided by the slope.
  const double size = std::max(edge1.size, edge2.size);
  const double slopes = std::abs(normal.x * d.x) + std::abs(normal.y * d.y) + std::abs(normal.z * d.z);
  const double spread = edge1.size * edge2.size * (size + corner.size / 16) + std::abs(t) * slopes;
  // The point may be off by a millionth of the longest edge.
  const double limit = 0x1p26 * size * std::abs(slope);
  const bool is_exact = spread * largest(d) <= limit && limit > 1e-280 && limit < 1e280;
  return is_exact ? ray.origin + d * t : place_triangle(instance, corners, ray.time).at(hit);
}

}  // namespace perfect_bvh
