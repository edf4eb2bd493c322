#include "scene/ray_batch.h"

#include <array>
#include <atomic>
#include <cmath>
#include <vector>

#include "scene/trace.h"

namespace perfect_bvh {
namespace {

// Rays a task takes at a time: enough to repay the hand-over, few enough to stop soon and to share out evenly.
constexpr std::size_t kTaskRays = 4096;
// Rays traced at a time: enough to keep many under way to the end, few enough for the second level cache.
constexpr std::size_t kBlockRays = 1024;

Ray load_ray(const RayColumns& columns, std::size_t row) {
  Ray ray;
  ray.origin = columns.origins_double ? columns.origins_double[row] : to_double(columns.origins_float[row]);
  ray.direction = columns.directions_double ? columns.directions_double[row] : to_double(columns.directions_float[row]);
  ray.t_min = columns.t_min[row * columns.t_min_stride];
  ray.t_max = columns.t_max[row * columns.t_max_stride];
  ray.mask = columns.masks[row * columns.mask_stride];
  return ray;
}

void store(float* column, std::size_t row, Vec3d value) {
  column[3 * row] = static_cast<float>(value.x);
  column[3 * row + 1] = static_cast<float>(value.y);
  column[3 * row + 2] = static_cast<float>(value.z);
}

void store_identity(const HitColumns& out, std::size_t row, const Snapshot& snapshot, const Hit& hit) {
  const bool found = hit.found();
  if (out.t) out.t[row] = hit.t;
  if (out.instance_ids) out.instance_ids[row] = found ? snapshot.instances[hit.instance_index].id : -1;
  if (out.mesh_ids) out.mesh_ids[row] = found ? snapshot.instances[hit.instance_index].mesh_id : -1;
  if (out.primitive_ids) out.primitive_ids[row] = found ? static_cast<std::int32_t>(hit.primitive_index) : -1;
  if (out.uvs) out.uvs[2 * row] = hit.u, out.uvs[2 * row + 1] = hit.v;
}

// The fields that need the triangle's corners.
void store_geometry(const HitColumns& out, std::size_t row, const Snapshot& snapshot, const Hit& hit, const Ray& ray) {
  if (out.distances) {
    // hypot: the square of a tiny or huge direction is not a number that a double can hold.
    const Vec3d d = ray.direction;
    out.distances[row] = hit.found() ? static_cast<double>(hit.t) * std::hypot(d.x, d.y, d.z) : kInfiniteDistance;
  }
  if (!out.normals && !out.positions && !out.front_face) return;
  Vec3d normal{0, 0, 0}, position{0, 0, 0};
  if (hit.found()) {
    normal = geometric_normal(snapshot, hit);
    position = hit_position(snapshot, hit);
  }
  if (out.normals) store(out.normals, row, normal);
  if (out.positions)
    out.positions[3 * row] = position.x, out.positions[3 * row + 1] = position.y,
                      out.positions[3 * row + 2] = position.z;
  if (out.front_face) out.front_face[row] = hit.found() && dot(normal, ray.direction) < 0 ? 1 : 0;
}

// Calls block(rays, first row) for every block of loaded rays, over the pool; counts the invalid ones.
template <class Block>
std::size_t for_each_block(const RayColumns& columns, ThreadPool& pool, int max_threads, CancelToken& cancel,
                           Block&& block) {
  std::atomic<std::size_t> invalid_count{0};
  cancel.expect(columns.count);
  const auto run = [&](std::size_t begin, std::size_t end) {
    cancel.throw_if_stopped();
    std::array<Ray, kBlockRays> rays;
    std::size_t invalid = 0;
    for (std::size_t first = begin; first < end; first += kBlockRays) {
      const std::size_t count = std::min(kBlockRays, end - first);
      for (std::size_t i = 0; i < count; ++i) {
        rays[i] = load_ray(columns, first + i);
        invalid += is_valid(rays[i]) ? 0 : 1;
      }
      block(std::span<const Ray>(rays.data(), count), first);
    }
    invalid_count.fetch_add(invalid, std::memory_order_relaxed);
    cancel.advance(end - begin);
  };
  parallel_for(pool, columns.count, kTaskRays, run, max_threads, [&] {
    cancel.poll();
    cancel.throw_if_stopped();
  });
  return invalid_count.load();
}

}  // namespace

std::size_t cast_rays(const Snapshot& snapshot, const RayColumns& columns, const HitColumns& out, ThreadPool& pool,
                      int max_threads, CancelToken& cancel) {
  const bool counted = out.nodes_visited || out.primitives_tested;
  return for_each_block(columns, pool, max_threads, cancel, [&](std::span<const Ray> rays, std::size_t first) {
    std::array<Hit, kBlockRays> hits;
    std::array<RayCounts, kBlockRays> counts;
    trace_closest(snapshot, rays, std::span(hits.data(), rays.size()), columns.cull,
                  counted ? std::span(counts.data(), rays.size()) : std::span<RayCounts>());
    for (std::size_t i = 0; i < rays.size(); ++i) {
      store_identity(out, first + i, snapshot, hits[i]);
      store_geometry(out, first + i, snapshot, hits[i], rays[i]);
      if (out.nodes_visited) out.nodes_visited[first + i] = static_cast<std::int32_t>(counts[i].nodes_visited);
      if (out.primitives_tested)
        out.primitives_tested[first + i] = static_cast<std::int32_t>(counts[i].primitives_tested);
    }
  });
}

std::size_t test_occlusions(const Snapshot& snapshot, const RayColumns& columns, std::uint8_t* occluded,
                            ThreadPool& pool, int max_threads, CancelToken& cancel) {
  return for_each_block(columns, pool, max_threads, cancel, [&](std::span<const Ray> rays, std::size_t first) {
    trace_occluded(snapshot, rays, std::span(occluded + first, rays.size()), columns.cull);
  });
}

}  // namespace perfect_bvh
