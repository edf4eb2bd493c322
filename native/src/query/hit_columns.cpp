#include "query/hit_columns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "math/elementary.h"
#include "query/facing.h"
#include "query/round_surface.h"
#include "query/trace.h"

namespace perfect_bvh {
namespace {

// Hits whose corners are prefetched together, so that their memory reads overlap.
constexpr std::size_t kFetchedHits = 64;

// Consecutive rows.
struct Rows {
  const Snapshot& snapshot;
  std::size_t first;
  std::span<const Hit> hits;
  std::span<const Ray> rays;
};

void store_instances(std::int32_t* column, const Rows& rows, std::int32_t Instance::* id) {
  for (std::size_t i = 0; i < rows.hits.size(); ++i) {
    const Hit& hit = rows.hits[i];
    column[i] = hit.found() ? rows.snapshot.instances[hit.instance_index].*id : -1;
  }
}

void store_identities(const HitColumns& out, const Rows& rows) {
  const std::size_t first = rows.first, count = rows.hits.size();
  if (out.t) std::transform(rows.hits.begin(), rows.hits.end(), out.t + first, [](const Hit& hit) { return hit.t; });
  if (out.instance_ids) store_instances(out.instance_ids + first, rows, &Instance::id);
  if (out.mesh_ids) store_instances(out.mesh_ids + first, rows, &Instance::mesh_id);
  if (out.primitive_ids) {
    static_assert(static_cast<std::int32_t>(kNoHit) == -1);
    for (std::size_t i = 0; i < count; ++i)
      out.primitive_ids[first + i] = static_cast<std::int32_t>(rows.hits[i].primitive_index);
  }
  if (out.uvs) {
    for (std::size_t i = 0; i < count; ++i) {
      out.uvs[2 * (first + i)] = rows.hits[i].u;
      out.uvs[2 * (first + i) + 1] = rows.hits[i].v;
    }
  }
}

// Overwrites the identities of curves and points, which were written by their internal primitives.
void store_round_identities(const HitColumns& out, const Rows& rows) {
  for (std::size_t i = 0; i < rows.hits.size(); ++i) {
    const Hit& hit = rows.hits[i];
    if (!hit.found()) continue;
    const Mesh& mesh = rows.snapshot.instances[hit.instance_index].blas->mesh;
    if (!mesh.is_round()) continue;
    const std::size_t row = rows.first + i;
    if (out.primitive_ids) {
      out.primitive_ids[row] = static_cast<std::int32_t>(caller_number(mesh, hit.primitive_index));
    }
    if (out.uvs) {
      out.uvs[2 * row] = u_of_part(mesh, hit.primitive_index, hit.u);
      out.uvs[2 * row + 1] = 0.0f;
    }
  }
}

template <class T>
void store(T* column, std::size_t row, Vec3d value) {
  column[3 * row] = static_cast<T>(value.x);
  column[3 * row + 1] = static_cast<T>(value.y);
  column[3 * row + 2] = static_cast<T>(value.z);
}

void store_round_geometry(const HitColumns& out, std::size_t row, const RoundPoint& point) {
  if (out.normals) store(out.normals, row, point.normal);
  if (out.positions) store(out.positions, row, point.position);
  if (out.front_face) out.front_face[row] = point.is_entry ? 1 : 0;
}

void store_no_geometry(const HitColumns& out, std::size_t row) {
  if (out.normals) store(out.normals, row, {0, 0, 0});
  if (out.positions) store(out.positions, row, {0, 0, 0});
  if (out.front_face) out.front_face[row] = 0;
}

// Places triangles as place_triangle does, but omits the translation of instances at rest: normals do not depend on it,
// and edges that are short compared with it would be rounded away. Takes a shortcut for instances that are only
// translated, which most are.
class Placer {
 public:
  [[nodiscard]] WorldTriangle place(const Instance& instance, TriangleIndices corners, const Ray& ray) noexcept {
    if (instance.motion != 0) return place_moving_triangle(instance, corners, ray.time);
    if (&instance != last_) {
      const Affine& map = instance.object_to_world;
      last_ = &instance;
      is_moved_only_ = map.x == Vec3d{1, 0, 0} && map.y == Vec3d{0, 1, 0} && map.z == Vec3d{0, 0, 1};
    }
    const Vec3f* const positions = instance.blas->mesh.positions.data();
    const Vec3d v0 = to_double(positions[corners.x]), v1 = to_double(positions[corners.y]);
    const Vec3d v2 = to_double(positions[corners.z]);
    if (is_moved_only_) return {v0, v1, v2};
    const Affine& map = instance.object_to_world;
    return {map.vector(v0), map.vector(v1), map.vector(v2)};
  }

 private:
  const Instance* last_ = nullptr;
  bool is_moved_only_ = false;
};

struct Placers {
  Placer triangles;
  RoundPlacer round;

  [[nodiscard]] RoundPoint place_round(const Instance& instance, const Hit& hit, const Ray& ray) noexcept {
    return instance.turns != nullptr ? RoundPlacer().place(posed(instance, ray.time), hit, ray)
                                     : round.place(instance, hit, ray);
  }
};

// Returns the distance of a hit whose t is below a float's normal numbers, from the hit point: if the direction is
// longer than 2^100, such a t is too coarse.
double distance_to_point(const Instance& instance, const Hit& hit, const Ray& ray, Placers& placers) noexcept {
  const Vec3d d = ray.direction;
  const double longest = largest_component(&d.x), factor = __builtin_scalbn(1.0, -__builtin_ilogb(longest));
  Ray shorter = ray;
  shorter.direction = d * factor;
  const Mesh& mesh = instance.blas->mesh;
  const Vec3d position = mesh.is_round() ? placers.place_round(instance, hit, ray).position
                                         : ray_position(instance, mesh.triangles[hit.primitive_index], hit, shorter);
  const Vec3d way = shorter.direction;
  return dot(position - ray.origin, way) / hypotenuse(way.x, way.y, way.z);
}

void store_distances(double* column, const Rows& rows) {
  constexpr float kLeastNormal = std::numeric_limits<float>::min();
  constexpr double kLeastFloat = 0x1p-149;
  Placers placers;
  for (std::size_t i = 0; i < rows.hits.size(); ++i) {
    const Hit& hit = rows.hits[i];
    if (!hit.found()) {
      column[i] = kInfiniteDistance;
      continue;
    }
    // Not length(): the square of a tiny or huge direction is out of a double's range.
    const Vec3d d = rows.rays[i].direction;
    const double length = hypotenuse(d.x, d.y, d.z);
    column[i] = static_cast<double>(hit.t) * length;
    if (std::abs(hit.t) >= kLeastNormal) continue;
    const Instance& instance = rows.snapshot.instances[hit.instance_index];
    const double distance = distance_to_point(instance, hit, rows.rays[i], placers);
    // If a ray begins at the surface, the point may be less exact than t.
    if (!(std::abs(distance - column[i]) > kLeastFloat * length)) column[i] = distance;
  }
}

// Stores the fields that need the triangle's corners, for at most kFetchedHits rows. For random triangles, every corner
// is a cache miss; with prefetching, the misses overlap.
void store_geometries(const HitColumns& out, const Rows& rows, Placers& placers) {
  std::array<TriangleIndices, kFetchedHits> corners;
  const Instance* const instances = rows.snapshot.instances.data();
  for (std::size_t i = 0; i < rows.hits.size(); ++i) {
    const Hit& hit = rows.hits[i];
    if (!hit.found()) continue;
    const Mesh& mesh = instances[hit.instance_index].blas->mesh;
    if (mesh.is_round()) continue;
    corners[i] = mesh.triangles[hit.primitive_index];
    for (const std::uint32_t corner : {corners[i].x, corners[i].y, corners[i].z})
      __builtin_prefetch(&mesh.positions[corner]);
  }
  for (std::size_t i = 0; i < rows.hits.size(); ++i) {
    const Hit& hit = rows.hits[i];
    const std::size_t row = rows.first + i;
    if (!hit.found()) {
      store_no_geometry(out, row);
      continue;
    }
    const Instance& instance = instances[hit.instance_index];
    if (instance.blas->mesh.is_round()) {
      store_round_geometry(out, row, placers.place_round(instance, hit, rows.rays[i]));
      continue;
    }
    if (out.normals) {
      const WorldTriangle triangle = placers.triangles.place(instance, corners[i], rows.rays[i]);
      store(out.normals, row, normalized(triangle.scaled_normal()));
    }
    if (out.front_face) out.front_face[row] = shows_front(rows.snapshot, hit, corners[i], rows.rays[i]) ? 1 : 0;
    if (out.positions) store(out.positions, row, ray_position(instance, corners[i], hit, rows.rays[i]));
  }
}

}  // namespace

void store_hits(const HitColumns& out, std::size_t first, const Snapshot& snapshot, std::span<const Hit> hits,
                std::span<const Ray> rays) {
  store_identities(out, {snapshot, first, hits, rays});
  if (snapshot.has_round_meshes && (out.primitive_ids || out.uvs)) {
    store_round_identities(out, {snapshot, first, hits, rays});
  }
  if (out.distances) store_distances(out.distances + first, {snapshot, first, hits, rays});
  if (!out.normals && !out.positions && !out.front_face) return;
  Placers placers;
  for (std::size_t done = 0; done < hits.size(); done += kFetchedHits) {
    const std::size_t count = std::min(kFetchedHits, hits.size() - done);
    store_geometries(out, {snapshot, first + done, hits.subspan(done, count), rays.subspan(done, count)}, placers);
  }
}

void store_counts(const HitColumns& out, std::size_t first, std::span<const RayCounts> counts) {
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (out.nodes_visited) out.nodes_visited[first + i] = static_cast<std::int32_t>(counts[i].nodes_visited);
    if (out.primitives_tested)
      out.primitives_tested[first + i] = static_cast<std::int32_t>(counts[i].primitives_tested);
  }
}

}  // namespace perfect_bvh
