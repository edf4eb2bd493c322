#include "render/surface/surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "math/elementary.h"
#include "query/round_surface.h"
#include "render/surface/object_triangle.h"

namespace perfect_bvh {

namespace {

// A corner normal that points this far to the other side of its triangle does not belong to a curved surface: the
// triangle is wound opposite to its neighbours.
constexpr double kTurnedCosine = -0.3;

// The vectors from the hit point to the curved surface implied by the corner normals, as in Cycles: rays that leave a
// coarse mesh from its flat triangles would hit its neighbours.
struct Lifts {
  Vec3d over, beyond;  // on the side of the normals, and on the other
};

// `side` is -1 if the viewer sees the inner side. The curve is a parabola along each edge. On either side, the distance
// of the surface is that of the nearest of three planes perpendicular to the corners' normals, each through the corner
// that is farthest along its normal; or half the distance of the curve if that is larger.
Lifts lifts_of(const CornerNormals& normals, const ObjectTriangle& triangle, double side) noexcept {
  const Vec3d point = triangle.point();
  std::array<Vec3d, 3> away;  // the corners relative to the point
  for (std::size_t i = 0; i < 3; ++i) away[i] = triangle.corners[i] - point;
  Vec3d between{0, 0, 0};
  double curve = 0.0;
  double over = std::numeric_limits<double>::infinity(), beyond = over;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3d normal = to_double(normals[i]) * side;
    const double own = dot(away[i], normal), next = dot(away[(i + 1) % 3], normal);
    const double last = dot(away[(i + 2) % 3], normal);
    over = std::min(over, std::max({own, next, last}));
    beyond = std::min(beyond, -std::min({own, next, last}));
    curve += own * triangle.weights[i];
    between = between + normal * triangle.weights[i];
  }
  return {between * std::max(over, 0.5 * curve), between * -std::max(beyond, -0.5 * curve)};
}

// Returns a bound of how far rounding may move a point of this triangle to a kernel's frame and back. In the mesh's
// frame, kernels use single precision: a coordinate is off by at most half a unit in its last place, 2^-24 of the
// largest one, and a triangle test adds a few of the same size. The map to the world scales that.
double clearance(const Instance& instance, const ObjectTriangle& triangle) noexcept {
  constexpr double kUnits = 8.0 * 0x1p-24;
  const auto reach = [&](int axis) {
    return std::max({std::abs(triangle.corners[0][axis]), std::abs(triangle.corners[1][axis]),
                     std::abs(triangle.corners[2][axis])});
  };
  const auto sum = [](Vec3d v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); };
  const Affine& map = instance.object_to_world;
  // The world's own double-precision rounding matters only far from its origin.
  const double world = sum(map.translation) * 0x1p-50;
  return kUnits * (sum(map.x) * reach(0) + sum(map.y) * reach(1) + sum(map.z) * reach(2)) + world;
}

// The same for curves and points, which kernels compute in double precision.
void set_round_normals(const Instance& instance, const Ray& ray, const Hit& hit, bool with_origin,
                       SurfacePoint& point) {
  const RoundPoint round = RoundPlacer().place(instance, hit, ray);
  // A tip has no normal: the direction back is as good as any.
  const bool degenerate = round.normal == Vec3d{0, 0, 0};
  const Vec3d facing = degenerate ? normalized(-ray.direction) : round.normal * (round.is_entry ? 1.0 : -1.0);
  point.geometric_normal = to_float(facing);
  point.inside = !round.is_entry;
  point.normal = point.light_normal = point.geometric_normal;
  point.along = to_float(normalized(round.along));
  if (!with_origin) return;
  const auto largest = [](Vec3d v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); };
  const double clear = 0x1p-40 * (largest(round.position) + largest(instance.object_to_world.translation));
  point.origin = round.position + facing * clear;
  point.beyond = round.position - facing * clear;
  point.ribbon_width = static_cast<float>(2.0 * round.ribbon_radius);
}

void set_normals(const Appearance& appearance, const Instance& instance, const Ray& ray, const Hit& hit,
                 bool with_origin, SurfacePoint& point) {
  if (instance.blas->mesh.is_round()) return set_round_normals(instance, ray, hit, with_origin, point);
  const ObjectTriangle triangle = object_triangle(instance, hit, ray.time);
  const MeshAttributes* attributes = appearance.attributes_of(instance);
  // A flattened mesh is a plane: its corner normals are ignored.
  const bool smooth = attributes != nullptr && !attributes->corner_normals.empty() && !instance.baked;
  const Vec3d outer = outer_normal(instance, triangle);
  // A triangle without area has no normal: the direction back is as good as any.
  const bool degenerate = outer == Vec3d{0, 0, 0};
  const double side = dot(outer, ray.direction) > 0.0 ? -1.0 : 1.0;
  const Vec3d facing = degenerate ? normalized(-ray.direction) : outer * side;
  point.geometric_normal = to_float(facing);
  point.inside = side < 0.0;
  point.normal = point.light_normal = point.geometric_normal;
  const Vec3d on_triangle = triangle.point();
  if (smooth) {
    const CornerNormals normals = corner_normals(appearance, *attributes, instance, hit, triangle);
    const Vec3d normal = world_normal(instance, object_normal(normals, triangle), facing * side) * side;
    const double light_side = dot(normal, facing) < kTurnedCosine ? -1.0 : 1.0;
    point.normal = to_float(normal);
    point.light_normal = to_float(normal * light_side);
    if (with_origin) {
      const Lifts lifts = lifts_of(normals, triangle, side * light_side);
      point.lift = to_float(instance.object_to_world.vector(lifts.over));
      point.lift_beyond = to_float(instance.object_to_world.vector(lifts.beyond));
    }
  }
  if (with_origin) {
    const Vec3d clear = facing * clearance(instance, triangle);
    point.origin = instance.object_to_world.point(on_triangle) + clear;
    point.beyond = instance.object_to_world.point(on_triangle) - clear;
  }
}

// A hit's data may be anywhere in memory, so they are prefetched: this many hits ahead the triangle and its layers,
// then the vertices that the triangle names. They were two fifths of this file's time.
constexpr std::size_t kTrianglesAhead = 16, kVerticesAhead = 8;

template <class T>
void fetch_corners(std::span<const T> layer, std::size_t primitive) noexcept {
  if (3 * primitive + 2 >= layer.size()) return;
  __builtin_prefetch(&layer[3 * primitive]);
  __builtin_prefetch(&layer[3 * primitive + 2]);
}

[[gnu::always_inline]] inline void fetch_triangle(const Snapshot& snapshot, const Appearance& appearance,
                                                  const Hit& hit) noexcept {
  if (!hit.found()) return;
  const Instance& instance = snapshot.instances[hit.instance_index];
  const Mesh& mesh = instance.blas->mesh;
  if (mesh.is_round()) return;
  const std::size_t primitive = hit.primitive_index;
  __builtin_prefetch(&mesh.triangles[primitive]);
  const MeshAttributes* const attributes = appearance.attributes_of(instance);
  if (attributes == nullptr) return;
  if (primitive < attributes->material_slots.size()) __builtin_prefetch(&attributes->material_slots[primitive]);
  fetch_corners(attributes->corner_normals, primitive);
  if (!attributes->uv_maps.empty()) fetch_corners(attributes->uv_maps[0], primitive);
}

[[gnu::always_inline]] inline void fetch_vertices(const Snapshot& snapshot, const Hit& hit) noexcept {
  if (!hit.found()) return;
  const Mesh& mesh = snapshot.instances[hit.instance_index].blas->mesh;
  if (mesh.is_round()) return;
  const TriangleIndices corners = mesh.triangles[hit.primitive_index];
  for (const std::uint32_t vertex : {corners.x, corners.y, corners.z}) __builtin_prefetch(&mesh.positions[vertex]);
}

}  // namespace

Vec3f material_color(const Appearance& appearance, std::int32_t material) noexcept {
  if (material == kNoMaterial) return kPlainColor;
  const Rgba& color = appearance.material_colors[static_cast<std::size_t>(material)];
  return {color.r, color.g, color.b};
}

void find_surfaces(const Snapshot& snapshot, const Appearance& appearance, SurfaceNeeds needs,
                   std::span<const Ray> rays, std::span<const Hit> hits, AlignedVector<SurfacePoint>& points) {
  for (std::size_t row = 0; row < hits.size(); ++row) {
    const Hit& hit = hits[row];
    if (row + kTrianglesAhead < hits.size()) fetch_triangle(snapshot, appearance, hits[row + kTrianglesAhead]);
    if (row + kVerticesAhead < hits.size()) fetch_vertices(snapshot, hits[row + kVerticesAhead]);
    if (!hit.found()) continue;
    const Instance& instance = snapshot.instances[hit.instance_index];
    if (!needs.holdouts && appearance.is_holdout(instance, hit.primitive_index)) continue;
    SurfacePoint& point = points.emplace_back();
    const Ray& ray = rays[row];
    point.ray = static_cast<std::uint32_t>(row), point.time = ray.time;
    if (needs.normals) {
      if (instance.turns == nullptr) {
        set_normals(appearance, instance, ray, hit, needs.origins, point);
      } else {
        set_normals(appearance, posed(instance, ray.time), ray, hit, needs.origins, point);
      }
    }
    point.mesh_normal = point.light_normal;
    if (needs.materials) {
      point.material = appearance.material_of(instance, hit.primitive_index);
      point.color = material_color(appearance, point.material);
    }
  }
}

}  // namespace perfect_bvh
