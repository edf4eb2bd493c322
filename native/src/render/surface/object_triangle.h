// The hit triangle in its mesh's frame, and the mesh's layers and normals interpolated between its corners.
// In: an instance and a hit. Out: corners, weights, interpolated values.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "query/round_surface.h"
#include "render/appearance/appearance.h"

namespace perfect_bvh {

// Interpolates one of a mesh's layers, uvs or colours, at a hit: between the corners of a triangle. For curves and
// points, returns the value of the whole one, or interpolates between the control points of a curve.
inline Vec3f mixed(Vec3f a, float share_a, Vec3f b, float share_b) noexcept { return a * share_a + b * share_b; }
inline Point2 mixed(Point2 a, float share_a, Point2 b, float share_b) noexcept {
  return {a.x * share_a + b.x * share_b, a.y * share_a + b.y * share_b};
}

// For curves and points; the layer is known to match the mesh.
template <class T>
T round_layer_at(const Mesh& mesh, const MeshAttributes& attributes, std::span<const T> layer,
                 const Hit& hit) noexcept {
  const std::size_t part = caller_number(mesh, hit.primitive_index);
  if (layer.size() == part_count_of(mesh)) return layer[part];
  const auto first = static_cast<std::size_t>(attributes.curve_offsets[part]);
  const std::size_t spans = static_cast<std::size_t>(attributes.curve_offsets[part + 1]) - first - 1;
  const float along = u_of_part(mesh, hit.primitive_index, hit.u) * static_cast<float>(spans);
  const std::size_t span = std::min(static_cast<std::size_t>(std::max(along, 0.0f)), spans - 1);
  const float u = along - static_cast<float>(span);
  return mixed(layer[first + span], 1.0f - u, layer[first + span + 1], u);
}

// Returns none if the mesh lacks the layer of that number. Throws InvalidArgument if it does not match the mesh.
template <class T>
std::optional<T> layer_at(const Appearance& appearance, const Instance& instance, const Hit& hit,
                          std::vector<std::span<const T>> MeshAttributes::* layers, std::int32_t number) {
  const MeshAttributes* const attributes = appearance.attributes_of(instance);
  const auto index = static_cast<std::size_t>(number);
  if (attributes == nullptr || index >= (attributes->*layers).size()) return std::nullopt;
  const std::span<const T> layer = (attributes->*layers)[index];
  if (layer.empty()) return std::nullopt;
  appearance.check_fits(instance, *attributes);
  const Mesh& mesh = instance.blas->mesh;
  if (mesh.is_round()) return round_layer_at(mesh, *attributes, layer, hit);
  const auto corners = layer.subspan(std::size_t{3} * hit.primitive_index).template first<3>();
  return mixed(mixed(corners[0], 1.0f - hit.u - hit.v, corners[1], hit.u), 1.0f, corners[2], hit.v);
}

// The hit triangle in its mesh's frame.
struct ObjectTriangle {
  std::array<Vec3d, 3> corners;
  std::array<double, 3> weights;  // of the corners, at the hit

  [[nodiscard]] Vec3d point() const noexcept {
    return corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
  }
};

inline ObjectTriangle object_triangle(const Instance& instance, const Hit& hit, float time) noexcept {
  const Mesh& mesh = instance.blas->mesh;
  const TriangleIndices corners = mesh.triangles[hit.primitive_index];
  const Moment moment = moment_of(instance, time);
  const double u = static_cast<double>(hit.u), v = static_cast<double>(hit.v);
  return {{to_double(mesh.position_at(corners.x, moment)), to_double(mesh.position_at(corners.y, moment)),
           to_double(mesh.position_at(corners.z, moment))},
          {1.0 - u - v, u, v}};
}

// Returns the normal, unit length, on the outer side by the mesh's own winding; zero for a triangle without area.
inline Vec3d outer_normal(const Instance& instance, const ObjectTriangle& triangle) noexcept {
  const Affine& map = instance.object_to_world;
  const Vec3d edge1 = map.vector(triangle.corners[1] - triangle.corners[0]);
  const Vec3d edge2 = map.vector(triangle.corners[2] - triangle.corners[0]);
  const Vec3d normal = normalized(cross(edge1, edge2));
  return instance.mirrored ? -normal : normal;
}

using CornerNormals = std::array<Vec3f, 3>;

// Transfers a triangle's normals from one time to another: they turn and shear with it.
inline CornerNormals carried(const CornerNormals& normals, const ObjectTriangle& from,
                             const ObjectTriangle& to) noexcept {
  const auto edge = [](const ObjectTriangle& triangle, int i) { return triangle.corners[i] - triangle.corners[0]; };
  const Vec3d a1 = edge(from, 1), a2 = edge(from, 2), b1 = edge(to, 1), b2 = edge(to, 2);
  const Vec3d a = normalized(cross(a1, a2)), b = normalized(cross(b1, b2));
  CornerNormals result = normals;
  for (Vec3f& corner : result) {
    const Vec3d normal = to_double(corner);
    const Vec3d turned =
        cross(b2, b) * dot(a1, normal) + cross(b, b1) * dot(a2, normal) + cross(b1, b2) * dot(a, normal);
    const double size = length(turned);
    if (size > 0.0 && std::isfinite(size)) corner = to_float(turned * (1.0 / size));
  }
  return result;
}

// Returns the normals of the triangle at the time of the hit.
inline CornerNormals corner_normals(const Appearance& appearance, const MeshAttributes& attributes,
                                    const Instance& instance, const Hit& hit, const ObjectTriangle& triangle) {
  appearance.check_fits(instance, attributes);
  const auto given = attributes.corner_normals.subspan(std::size_t{3} * hit.primitive_index).first<3>();
  const CornerNormals normals{given[0], given[1], given[2]};
  if (!instance.blas->mesh.moves()) return normals;
  return carried(normals, object_triangle(instance, hit, appearance.frame_time), triangle);
}

// Interpolates between the corners, in the mesh's frame; not normalized.
inline Vec3d object_normal(const CornerNormals& normals, const ObjectTriangle& triangle) noexcept {
  return to_double(normals[0]) * triangle.weights[0] + to_double(normals[1]) * triangle.weights[1] +
         to_double(normals[2]) * triangle.weights[2];
}

// Transforms a normal from the mesh's frame to world space, with unit length; `fallback` if it has no direction.
inline Vec3d world_normal(const Instance& instance, Vec3d object, Vec3d fallback) noexcept {
  // Uses the cofactors, which equal the inverse's transpose up to a factor.
  const Affine& map = instance.object_to_world;
  const Vec3d world =
      (cross(map.y, map.z) * object.x + cross(map.z, map.x) * object.y + cross(map.x, map.y) * object.z) *
      (instance.mirrored ? -1.0 : 1.0);
  const double size = length(world);
  return size > 0.0 && std::isfinite(size) ? world * (1.0 / size) : fallback;
}

}  // namespace perfect_bvh
