#include "query/closest_points.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "math/distance.h"
#include "query/round_surface.h"
#include "query/trace.h"
#include "tlas/assemble.h"
#include "traverse/dispatch.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kBlockPoints = 256;

PointQuery load_query(const PointColumns& columns, std::size_t row) {
  const Vec3d p = columns.points[row];
  return {{p.x, p.y, p.z},
          columns.max_distances[row * columns.max_distance_stride],
          columns.masks[row * columns.mask_stride],
          columns.times[row * columns.time_stride]};
}

bool is_valid(const PointQuery& query) {
  const double* const p = query.position;
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]) && query.max_distance >= 0.0 &&
         is_in_shutter(query.time);
}

// Returns the nearest point of a curve or point, which are solid: the query's own position if it is inside.
Vec3d nearest_on_solid(const Instance& instance, const PointQuery& query, std::uint32_t primitive) {
  const Mesh& mesh = instance.blas->mesh;
  const Affine map = place_at(instance, query.time);
  const double columns[9] = {map.x.x, map.x.y, map.x.z, map.y.x, map.y.y, map.y.z, map.z.x, map.z.y, map.z.z};
  const double* const p = query.position;
  const double from[3] = {p[0] - map.translation.x, p[1] - map.translation.y, p[2] - map.translation.z};
  const RoundEnds ends = ends_of(round_list(mesh, moment_of(instance, query.time)), primitive);
  const NearestOnRound found = nearest_on_round(round_place(columns), ends, from);
  if (found.is_inside) return {p[0], p[1], p[2]};
  return map.point({found.point[0], found.point[1], found.point[2]});
}

Vec3d nearest_position(const Snapshot& snapshot, const PointQuery& query, const NearestPoint& nearest) {
  const Instance& instance = snapshot.instances[nearest.instance_index];
  if (instance.blas->mesh.is_round()) return nearest_on_solid(instance, query, nearest.primitive_index);
  const WorldTriangle triangle =
      world_triangle(snapshot, {0.0f, 0.0f, 0.0f, nearest.instance_index, nearest.primitive_index}, query.time);
  const double u = nearest.u, v = nearest.v;
  return triangle.v0 * (1.0 - u - v) + triangle.v1 * u + triangle.v2 * v;
}

void store(const ClosestColumns& out, std::size_t row, const Snapshot& snapshot, const PointQuery& query,
           const NearestPoint& nearest) {
  const bool found = nearest.instance_index != kNoHit;
  const Vec3d point = found ? nearest_position(snapshot, query, nearest) : Vec3d{0, 0, 0};
  for (int axis = 0; axis < 3; ++axis) out.points[3 * row + static_cast<std::size_t>(axis)] = point[axis];
  out.distances[row] = found ? std::sqrt(nearest.squared) : static_cast<double>(kInfiniteDistance);
  out.instance_ids[row] = found ? snapshot.instances[nearest.instance_index].id : -1;
  out.mesh_ids[row] = found ? snapshot.instances[nearest.instance_index].mesh_id : -1;
  out.primitive_ids[row] = -1;
  out.uvs[2 * row] = out.uvs[2 * row + 1] = 0.0f;
  if (!found) return;
  const Mesh& mesh = snapshot.instances[nearest.instance_index].blas->mesh;
  out.primitive_ids[row] = static_cast<std::int32_t>(caller_number(mesh, nearest.primitive_index));
  out.uvs[2 * row] = u_of_part(mesh, nearest.primitive_index, static_cast<float>(nearest.u));
  out.uvs[2 * row + 1] = static_cast<float>(nearest.v);
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
      with_view(snapshot, cancel, [&](const SceneView& view) {
        find_closest_points(view, std::span(queries.data(), count), std::span(nearest.data(), count));
      });
      for (std::size_t i = 0; i < count; ++i) store(out, first + i, snapshot, queries[i], nearest[i]);
    }
    invalid_count.fetch_add(invalid, std::memory_order_relaxed);
  });
  return invalid_count.load();
}

}  // namespace perfect_bvh
