#include "scene/trace.h"

#include <algorithm>

#include "math/slab.h"
#include "math/triangle.h"
#include "traverse/bvh2_traversal.h"
#include "traverse/object_ray.h"

namespace perfect_bvh {
namespace {

std::size_t deepest_blas(const Snapshot& snapshot) {
  std::uint32_t depth = 0;
  for (const auto& blas : snapshot.blases) depth = std::max(depth, blas->tree.depth);
  return depth;
}

bool culled(Cull cull, Facing facing, bool mirrored) {
  if (cull == Cull::kNone) return false;
  const bool front_in_world = (facing == Facing::kFront) != mirrored;
  return front_in_world == (cull == Cull::kFront);
}

// Follows one ray at a time through both levels. Holds the stacks, so that a batch allocates once.
class Tracer {
 public:
  Tracer(const Snapshot& snapshot, Cull cull)
      : snapshot_(snapshot), cull_(cull), stack_(snapshot.tlas.depth + 1 + deepest_blas(snapshot) + 1) {}

  template <bool kAny>
  Hit trace(const Ray& ray, RayCounts* counts) {
    Hit best;
    if (!is_valid(ray)) return best;
    const ObjectRay world(Affine{}, ray.origin, ray.direction);
    const SlabRay slabs(world.origin, world.direction, snapshot_.tlas.bounds());
    const auto [top, bottom] = split_stack();
    float t_max = world.to_object(ray.t_max);
    const float t_min = world.to_object(ray.t_min);
    const Bvh2& tlas = snapshot_.tlas;
    float best_t = ray.t_max;
    traverse_bvh2(tlas, slabs, t_min, t_max, top, counts, [&](std::uint32_t first, std::uint32_t count, float& limit) {
      for (std::uint32_t i = first; i < first + count; ++i) {
        const std::uint32_t index = tlas.prim_indices[i];
        const Instance& instance = snapshot_.instances[index];
        if ((instance.mask & ray.mask) == 0) continue;
        const SlabRange box = slabs.range(instance.world_bounds.lower, instance.world_bounds.upper, -kInfiniteDistance,
                                          kInfiniteDistance);
        if (!(box.near <= box.far && box.far >= t_min && box.near <= limit)) continue;
        if (trace_instance<kAny>(ray, index, world.to_world(box.near), best_t, best, counts)) return true;
        limit = std::min(limit, world.to_object(best_t));
      }
      return false;
    });
    return best;
  }

 private:
  std::pair<std::span<StackEntry>, std::span<StackEntry>> split_stack() {
    const std::span<StackEntry> all(stack_);
    return {all.first(snapshot_.tlas.depth + 1), all.subspan(snapshot_.tlas.depth + 1)};
  }

  // True if the search may end. best_t and best: the best hit so far, in the world ray's terms. No hit is reported
  // before `entry`, where the ray enters the instance's box: so the top level may prune by that box.
  template <bool kAny>
  bool trace_instance(const Ray& ray, std::uint32_t index, float entry, float& best_t, Hit& best, RayCounts* counts) {
    const Instance& instance = snapshot_.instances[index];
    const Blas& blas = *instance.blas;
    const ObjectRay object(instance.world_to_object, ray.origin, ray.direction);
    if (!is_finite(object.origin) || object.t_scale == 0) return false;  // so far away that float cannot hold it
    const SlabRay slabs(object.origin, object.direction, blas.tree.bounds());
    const TriangleRay triangle_ray(object.origin, object.direction);
    const float t_min = object.to_object(ray.t_min);
    float t_max = object.to_object(best_t);
    bool stop = false;
    const auto visit_leaf = [&](std::uint32_t first, std::uint32_t count, float& limit) {
      if (counts != nullptr) counts->primitives_tested += count;
      for (std::uint32_t i = first; i < first + count; ++i) {
        const std::uint32_t primitive = blas.tree.prim_indices[i];
        const TriangleIndices corners = blas.mesh.triangles[primitive];
        const Vec3f v0 = blas.mesh.positions[corners.x], v1 = blas.mesh.positions[corners.y],
                    v2 = blas.mesh.positions[corners.z];
        const SlabRange box =
            slabs.range(min(v0, min(v1, v2)), max(v0, max(v1, v2)), -kInfiniteDistance, kInfiniteDistance);
        TriangleHit hit;
        Facing facing;
        if (!intersect_triangle(triangle_ray, v0, v1, v2, box, hit, facing)) continue;
        const float t = std::max(entry, object.to_world(hit.t));
        if (!(t >= ray.t_min && t <= best_t) || t == kInfiniteDistance) continue;
        if (culled(cull_, facing, instance.mirrored)) continue;
        if (t == best_t && best.found() && !wins_tie(instance, primitive, best)) continue;
        best_t = t;
        best = {t, hit.u, hit.v, index, primitive};
        limit = object.to_object(t);
        if (kAny) return stop = true;
      }
      return false;
    };
    traverse_bvh2(blas.tree, slabs, t_min, t_max, split_stack().second, counts, visit_leaf);
    return stop;
  }

  [[nodiscard]] bool wins_tie(const Instance& instance, std::uint32_t primitive, const Hit& best) const {
    const Instance& holder = snapshot_.instances[best.instance_index];
    if (instance.order != holder.order) return instance.order < holder.order;
    if (instance.id != holder.id) return instance.id < holder.id;
    return primitive < best.primitive_index;
  }

  const Snapshot& snapshot_;
  Cull cull_;
  std::vector<StackEntry> stack_;
};

}  // namespace

void trace_closest(const Snapshot& snapshot, std::span<const Ray> rays, std::span<Hit> hits, Cull cull,
                   std::span<RayCounts> counts) {
  Tracer tracer(snapshot, cull);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RayCounts* const count = counts.empty() ? nullptr : &(counts[i] = {});
    hits[i] = tracer.trace<false>(rays[i], count);
  }
}

void trace_occluded(const Snapshot& snapshot, std::span<const Ray> rays, std::span<std::uint8_t> occluded, Cull cull,
                    std::span<RayCounts> counts) {
  Tracer tracer(snapshot, cull);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RayCounts* const count = counts.empty() ? nullptr : &(counts[i] = {});
    occluded[i] = tracer.trace<true>(rays[i], count).found() ? 1 : 0;
  }
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
