// The answer that every kernel must give, bit for bit: every triangle of every instance tried in turn, with the scalar
// arithmetic of math/triangle.h and traverse/object_ray.h. No tree, so no tree can influence it.
#pragma once

#include <algorithm>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

#include "math/triangle.h"
#include "tlas/snapshot.h"
#include "traverse/object_ray.h"

namespace perfect_bvh::test {

struct ReferenceHit {
  double t;
  Hit hit;
};

// Every triangle that the ray meets, by (t, order, id, primitive).
inline std::vector<ReferenceHit> reference_hits(const Snapshot& snapshot, const Ray& ray, Cull cull) {
  std::vector<ReferenceHit> found;
  if (!is_valid(ray)) return found;
  ObjectRay world{{ray.origin.x, ray.origin.y, ray.origin.z, 0.0},
                  {ray.direction.x, ray.direction.y, ray.direction.z, 0.0},
                  {0.0, 1.0, true}};
  for (int axis = 0; axis < 3; ++axis) {
    world.origin[axis] *= static_cast<double>(snapshot.view.scale);
    world.direction[axis] *= static_cast<double>(snapshot.view.scale);
  }
  if (!bring_near(world, static_cast<double>(snapshot.view.reach))) return found;
  for (std::size_t index = 0; index < snapshot.instances.size(); ++index) {
    const Instance& instance = snapshot.instances[index];
    const InstanceView& view = snapshot.instance_views[index];
    if ((instance.mask & ray.mask) == 0) continue;
    ObjectRay local;
    map_ray(local, world, view.world_to_local);
    if (!bring_near(local, static_cast<double>(view.extent.reach))) continue;
    float origin[3], direction[3];
    narrow(local.origin, origin);
    narrow(local.direction, direction);
    TriangleRay triangle_ray;
    set_triangle_ray(triangle_ray, origin, direction, longest_axis(direction), view.extent);
    const Mesh& mesh = instance.blas->mesh;
    for (std::uint32_t primitive = 0; primitive < mesh.primitive_count(); ++primitive) {
      const TriangleIndices corners = mesh.triangles[primitive];
      Vec3f p[3] = {mesh.positions[corners.x], mesh.positions[corners.y], mesh.positions[corners.z]};
      for (Vec3f& corner : p) corner = corner * instance.blas->wide.scale;
      const float* const rows[3] = {&p[0].x, &p[1].x, &p[2].x};
      TriangleHit hit;
      if (!intersect_triangle(triangle_ray, local.origin, local.direction, rows, hit)) continue;
      const double t = to_ray_t(local.time, hit.t);
      const float narrowed = static_cast<float>(t);
      if (!(narrowed >= ray.t_min && narrowed <= ray.t_max && narrowed < kInfiniteDistance)) continue;
      if (cull != Cull::kNone && (hit.is_front != instance.mirrored) == (cull == Cull::kFront)) continue;
      found.push_back({t, {narrowed + 0.0f, hit.u, hit.v, static_cast<std::uint32_t>(index), primitive}});
    }
  }
  const auto key = [&](const ReferenceHit& item) {
    const Instance& instance = snapshot.instances[item.hit.instance_index];
    return std::tuple(item.t, instance.order, instance.id, item.hit.primitive_index);
  };
  std::sort(found.begin(), found.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
  return found;
}

inline Hit reference_closest(const Snapshot& snapshot, const Ray& ray, Cull cull) {
  const std::vector<ReferenceHit> found = reference_hits(snapshot, ray, cull);
  return found.empty() ? Hit{} : found.front().hit;
}

// Half of them towards triangles, half of them anywhere.
inline std::vector<Ray> rays_at(const Mesh& mesh, std::size_t count) {
  Aabb box;
  for (const Vec3f& position : mesh.positions) box.grow(position);
  if (box.is_empty()) box = {{-1, -1, -1}, {1, 1, 1}};
  std::mt19937 random(12);
  std::uniform_real_distribution<double> share(0, 1);
  const auto point_in_box = [&] {
    const Vec3d lower = to_double(box.lower), extent = to_double(box.upper) - lower;
    return lower + Vec3d{share(random), share(random), share(random)} * extent;
  };
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    Vec3d target = point_in_box();
    if (i % 2 == 0 && mesh.primitive_count() > 0) {
      const TriangleIndices t = mesh.triangles[random() % mesh.primitive_count()];
      const double u = share(random) * 0.5, v = share(random) * 0.5;
      const Vec3d a = to_double(mesh.positions[t.x]), b = to_double(mesh.positions[t.y]),
                  c = to_double(mesh.positions[t.z]);
      target = a * (1 - u - v) + b * u + c * v;
    }
    Ray ray{};
    ray.origin = point_in_box();
    ray.direction = target - ray.origin;
    ray.t_min = 0.0f, ray.t_max = std::numeric_limits<float>::infinity(), ray.mask = ~0u;
    rays.push_back(ray);
  }
  return rays;
}

}  // namespace perfect_bvh::test
