#include "query/closest_points.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "query/ray_columns.h"
#include "query/trace.h"
#include "tlas/lazy_trees.h"
#include "traverse/dispatch.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kBlockPoints = 256;

PointQuery load_query(const PointColumns& columns, std::size_t row) {
  const Vec3d p = columns.points[row];
  return {{p.x, p.y, p.z},
          columns.max_distances[row * columns.max_distance_stride],
          columns.masks[row * columns.mask_stride]};
}

bool is_valid(const PointQuery& query) {
  const double* const p = query.position;
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]) && query.max_distance >= 0.0;
}

void store(const ClosestColumns& out, std::size_t row, const Snapshot& snapshot, const NearestPoint& nearest) {
  const bool found = nearest.instance_index != kNoHit;
  Vec3d point{0, 0, 0};
  if (found) {
    const Hit corner{0.0f, 0.0f, 0.0f, nearest.instance_index, nearest.primitive_index};
    const WorldTriangle triangle = world_triangle(snapshot, corner);
    const double u = nearest.u, v = nearest.v;
    point = triangle.v0 * (1.0 - u - v) + triangle.v1 * u + triangle.v2 * v;
  }
  for (int axis = 0; axis < 3; ++axis) out.points[3 * row + static_cast<std::size_t>(axis)] = point[axis];
  out.distances[row] = found ? std::sqrt(nearest.squared) : static_cast<double>(kInfiniteDistance);
  out.instance_ids[row] = found ? snapshot.instances[nearest.instance_index].id : -1;
  out.mesh_ids[row] = found ? snapshot.instances[nearest.instance_index].mesh_id : -1;
  out.primitive_ids[row] = found ? static_cast<std::int32_t>(nearest.primitive_index) : -1;
  out.uvs[2 * row] = found ? static_cast<float>(nearest.u) : 0.0f;
  out.uvs[2 * row + 1] = found ? static_cast<float>(nearest.v) : 0.0f;
}

}  // namespace

std::size_t compute_closest_points(const Snapshot& snapshot, const PointColumns& columns, const ClosestColumns& out,
                                   ThreadPool& pool, int max_threads, CancelToken& cancel) {
  std::atomic<std::size_t> invalid_count{0};
  for_each_task(columns.count, pool, max_threads, cancel, [&](std::size_t begin, std::size_t end) {
    std::array<PointQuery, kBlockPoints> queries;
    std::array<NearestPoint, kBlockPoints> nearest;
    std::size_t invalid = 0;
    for (std::size_t first = begin; first < end; first += kBlockPoints) {
      const std::size_t count = std::min(kBlockPoints, end - first);
      for (std::size_t i = 0; i < count; ++i) {
        queries[i] = load_query(columns, first + i);
        invalid += is_valid(queries[i]) ? 0 : 1;
      }
      with_trees(snapshot, cancel, [&](const SceneView& view) {
        find_closest_points(view, std::span(queries.data(), count), std::span(nearest.data(), count));
      });
      for (std::size_t i = 0; i < count; ++i) store(out, first + i, snapshot, nearest[i]);
    }
    invalid_count.fetch_add(invalid, std::memory_order_relaxed);
  });
  return invalid_count.load();
}

}  // namespace perfect_bvh
