#include "query/facing.h"

#include <cmath>

#include "math/exact_edges.h"
#include "tlas/assemble.h"
#include "wide/wide_bvh.h"

// The kernels' own mapping from the world to an instance.
#include "traverse/isa_scalar.h"
#include "traverse/leaf_line_scalar.h"

namespace perfect_bvh {
namespace {

// Needs the vectors and the ray's set-up.
#include "traverse/pace.inl"
#include "traverse/ray_slot.inl"

struct LocalDirection {
  double d[3];
  bool is_mirrored;  // the instance reverses the winding
};

// Scales by a power of two, as bring_near() does, so that no product with corners underflows a double.
LocalDirection scaled(const ObjectRay& local, bool is_mirrored) noexcept {
  const double longest = largest_component(local.direction);
  const double factor = longest > 0.0 ? __builtin_scalbn(1.0, -__builtin_ilogb(longest)) : 1.0;
  const double* const d = local.direction;
  return {{d[0] * factor, d[1] * factor, d[2] * factor}, is_mirrored};
}

LocalDirection local_direction(const Snapshot& snapshot, std::uint32_t row, const Ray& ray) noexcept {
  const SceneView& scene = snapshot.view;
  const InstanceView& view = snapshot.instance_views[row];
  const double scale = static_cast<double>(scene.scale);
  if (view.motion == 0) {
    ObjectRay world, local;
    load_ray(world, ray, scale);
    map_to_local(local, world, view.world_to_local);
    return scaled(local, view.mirrored != 0);
  }
  Slot slot;
  load_ray(slot.world, ray, scale);
  slot.is_mirrored = view.mirrored != 0;
  static_cast<void>(map_to_moving(slot, scene, view, ray.time));  // the ray hit it, so it could be mapped
  return scaled(slot.local, slot.is_mirrored);
}

double exact_facing(const double direction[3], const float* const corners[3]) noexcept {
  const double origin[3] = {static_cast<double>(corners[0][0]), static_cast<double>(corners[0][1]),
                            static_cast<double>(corners[0][2])};
  const ExactWeights weights = exact_weights(origin, direction, corners);  // seen from a corner: two weights are 0
  return (weights.w[0] + weights.w[1]) + weights.w[2];
}

}  // namespace

bool shows_front(const Snapshot& snapshot, const Hit& hit, TriangleIndices corners, const Ray& ray) noexcept {
  const Instance& instance = snapshot.instances[hit.instance_index];
  const Mesh& mesh = instance.blas->mesh;
  const Moment moment = moment_of(instance, ray.time);
  const float scale = instance.blas->wide.scale;
  const Vec3f p0 = mesh.position_at(corners.x, moment) * scale, p1 = mesh.position_at(corners.y, moment) * scale;
  const Vec3f p2 = mesh.position_at(corners.z, moment) * scale;
  const auto [d, is_mirrored] = local_direction(snapshot, hit.instance_index, ray);
  const Vec3d edge1 = to_double(p1) - to_double(p0), edge2 = to_double(p2) - to_double(p0);
  const Vec3d normal = cross(edge1, edge2);
  double facing = -dot(normal, {d[0], d[1], d[2]});
  // Edges are rounded by 2^-53 of their length, the six products by four times that, and their sums: at most 2^-49 of
  // this in all.
  const double size = largest_component(&edge1.x) * largest_component(&edge2.x);
  const double length = (std::abs(d[0]) + std::abs(d[1])) + std::abs(d[2]);
  if (!(std::abs(facing) > 0x1p-48 * (size * length))) {
    const float* const exact[3] = {&p0.x, &p1.x, &p2.x};
    facing = exact_facing(d, exact);
  }
  return (facing > 0.0) != is_mirrored;
}

}  // namespace perfect_bvh
