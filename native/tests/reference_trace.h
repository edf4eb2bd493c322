// The answer that every kernel must give, bit for bit: it tests every primitive of every instance, with the scalar
// arithmetic of math/triangle.h, math/curve_joint.h and traverse/ray.h. It uses no tree, so no tree can influence it.
#pragma once

#include <algorithm>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

#include "math/curve_joint.h"
#include "math/triangle.h"
#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh::test {

struct ReferenceHit {
  double t;
  Hit hit;
};

// An instance, and the ray in the space of its tree.
struct ReferenceInstance {
  const Instance& instance;
  const TreeExtent& extent;
  std::uint32_t index;
  ObjectRay local;
};

inline bool is_in_reference_range(double t, const Ray& ray) {
  const float narrowed = static_cast<float>(t);
  return narrowed >= ray.t_min && narrowed <= ray.t_max && narrowed < kInfiniteDistance;
}

inline void add_triangles(std::vector<ReferenceHit>& found, const ReferenceInstance& at, const Ray& ray, Cull cull) {
  float origin[3], direction[3];
  narrow(at.local.origin, origin);
  narrow(at.local.direction, direction);
  TriangleRay triangle_ray;
  set_triangle_ray(triangle_ray, origin, direction, longest_axis(direction), at.extent);
  const Mesh& mesh = at.instance.blas->mesh;
  for (std::uint32_t primitive = 0; primitive < mesh.primitive_count(); ++primitive) {
    const TriangleIndices corners = mesh.triangles[primitive];
    Vec3f p[3] = {mesh.positions[corners.x], mesh.positions[corners.y], mesh.positions[corners.z]};
    for (Vec3f& corner : p) corner = corner * at.instance.blas->wide.scale;
    const float* const rows[3] = {&p[0].x, &p[1].x, &p[2].x};
    TriangleHit hit;
    if (!intersect_triangle(triangle_ray, exact_ray(at.local), rows, hit)) continue;
    const double t = to_ray_t(at.local.time, hit.t);
    if (!is_in_reference_range(t, ray)) continue;
    if (cull == Cull::kBack && hit.is_front == at.instance.mirrored) continue;
    found.push_back({t, {static_cast<float>(t) + 0.0f, hit.u, hit.v, at.index, primitive}});
  }
}

// Adds the entry and the exit of the ray for each curve segment or point, where they are visible.
inline void add_rounds(std::vector<ReferenceHit>& found, const ReferenceInstance& at, const Ray& ray, Cull cull) {
  const Mesh& mesh = at.instance.blas->mesh;
  const RoundList list{mesh.balls.data(), mesh.segments.data(), at.instance.blas->wide.scale};
  const RoundRay local = round_ray(at.local.origin, at.local.direction);
  const auto add = [&](double local_t, std::uint32_t primitive) {
    const double t = to_ray_t(at.local.time, static_cast<float>(local_t));
    if (!is_in_reference_range(t, ray)) return;
    const RoundEnds ends = ends_of(list, primitive);
    const bool is_point = mesh.kind == PrimitiveKind::kPoints;
    const float u = is_point ? 0.0f : static_cast<float>(share_at(local, ends.first, ends.last, local_t));
    found.push_back({t, {static_cast<float>(t) + 0.0f, u, 0.0f, at.index, primitive}});
  };
  for (std::uint32_t primitive = 0; primitive < mesh.primitive_count(); ++primitive) {
    const Chord chord = chord_of(local, list, primitive);
    if (!is_hit(chord)) continue;
    const ShownEnds shows = shown_ends(local, list, primitive, chord);
    if (shows.entry) add(chord.entry, primitive);
    if (shows.exit && cull != Cull::kBack) add(chord.exit, primitive);
  }
}

// All hits of the ray, sorted by (t, order, id, primitive); for each primitive its entry before its exit.
inline std::vector<ReferenceHit> reference_hits(const Snapshot& snapshot, const Ray& ray, Cull cull) {
  std::vector<ReferenceHit> found;
  if (!is_valid(ray)) return found;
  ObjectRay world{};
  const double scale = static_cast<double>(snapshot.view.scale);
  const Vec3d origin = ray.origin * scale, direction = ray.direction * scale;
  for (int axis = 0; axis < 3; ++axis) {
    world.origin[axis] = (&origin.x)[axis], world.direction[axis] = (&direction.x)[axis];
  }
  world.time = {0.0, 1.0, true};
  ObjectRay near = world;
  if (!bring_near(near, static_cast<double>(snapshot.view.reach))) return found;
  for (std::size_t index = 0; index < snapshot.instances.size(); ++index) {
    const Instance& instance = snapshot.instances[index];
    const InstanceView& view = snapshot.instance_views[index];
    if ((instance.mask & ray.mask) == 0) continue;
    ObjectRay local;
    map_ray(local, world, view.world_to_local);
    if (!bring_near(local, static_cast<double>(view.extent.reach))) continue;
    const ReferenceInstance at{instance, view.extent, static_cast<std::uint32_t>(index), local};
    if (instance.blas->mesh.is_round()) {
      add_rounds(found, at, ray, cull);
    } else {
      add_triangles(found, at, ray, cull);
    }
  }
  const auto key = [&](const ReferenceHit& item) {
    const Instance& instance = snapshot.instances[item.hit.instance_index];
    return std::tuple(item.t, instance.order, instance.id, item.hit.primitive_index);
  };
  std::stable_sort(found.begin(), found.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
  return found;
}

inline Hit reference_closest(const Snapshot& snapshot, const Ray& ray, Cull cull) {
  const std::vector<ReferenceHit> found = reference_hits(snapshot, ray, cull);
  return found.empty() ? Hit{} : found.front().hit;
}

// Half of the rays aim at triangles, the other half go anywhere.
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
