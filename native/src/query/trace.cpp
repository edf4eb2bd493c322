#include "query/trace.h"

#include "tlas/lazy_trees.h"
#include "traverse/dispatch.h"

namespace perfect_bvh {

std::size_t trace_closest(const Snapshot& snapshot, CancelToken& cancel, std::span<const Ray> rays, std::span<Hit> hits,
                          Cull cull, std::span<RayCounts> counts, Strategy strategy) {
  const RayBatch batch{rays.data(), rays.size(), cull, counts.empty() ? nullptr : counts.data(), hits.data(), nullptr};
  std::size_t in_packets = 0;
  with_trees(snapshot, cancel,
             [&](const SceneView& view) { in_packets = trace_closest(view, batch, TraceOptions{strategy}); });
  return in_packets;
}

std::size_t trace_occluded(const Snapshot& snapshot, CancelToken& cancel, std::span<const Ray> rays,
                           std::span<std::uint8_t> occluded, Cull cull, std::span<RayCounts> counts,
                           Strategy strategy) {
  const RayBatch batch{rays.data(), rays.size(),    cull, counts.empty() ? nullptr : counts.data(),
                       nullptr,     occluded.data()};
  std::size_t in_packets = 0;
  with_trees(snapshot, cancel,
             [&](const SceneView& view) { in_packets = trace_any(view, batch, TraceOptions{strategy}); });
  return in_packets;
}

WorldTriangle world_triangle(const Snapshot& snapshot, const Hit& hit) noexcept {
  const Instance& instance = snapshot.instances[hit.instance_index];
  const TriangleMesh& mesh = instance.blas->mesh;
  const TriangleIndices corners = mesh.triangles[hit.primitive_index];
  const auto place = [&](std::uint32_t vertex) {
    return instance.object_to_world.point(to_double(mesh.positions[vertex]));
  };
  return {place(corners.x), place(corners.y), place(corners.z)};
}

Vec3d geometric_normal(const Snapshot& snapshot, const Hit& hit) noexcept {
  const WorldTriangle triangle = world_triangle(snapshot, hit);
  return normalized(cross(triangle.v1 - triangle.v0, triangle.v2 - triangle.v0));
}

Vec3d hit_position(const Snapshot& snapshot, const Hit& hit) noexcept {
  const WorldTriangle triangle = world_triangle(snapshot, hit);
  const double u = hit.u, v = hit.v;
  return triangle.v0 * (1.0 - u - v) + triangle.v1 * u + triangle.v2 * v;
}

}  // namespace perfect_bvh
