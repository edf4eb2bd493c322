// What one of a mesh's layers, uvs or colours, has where a ray hit: between the corners of a triangle, and of curves
// and points either what a whole one has, or between the control points of a curve.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "math/vec3.h"
#include "mesh/round_mesh.h"
#include "render/appearance/appearance.h"
#include "render/sampling/sampler.h"
#include "traverse/ray.h"

namespace perfect_bvh {

[[nodiscard]] inline Vec3f mixed(Vec3f a, float share_a, Vec3f b, float share_b) noexcept {
  return a * share_a + b * share_b;
}
[[nodiscard]] inline Point2 mixed(Point2 a, float share_a, Point2 b, float share_b) noexcept {
  return {a.x * share_a + b.x * share_b, a.y * share_a + b.y * share_b};
}

// Of curves and points; the layer is known to fit.
template <class T>
[[nodiscard]] T round_layer_at(const Mesh& mesh, const MeshAttributes& attributes, std::span<const T> layer,
                               const Hit& hit) noexcept {
  const std::size_t part = caller_number(mesh, hit.primitive_index);
  if (layer.size() == given_part_count(mesh)) return layer[part];
  const auto first = static_cast<std::size_t>(attributes.curve_offsets[part]);
  const std::size_t spans = static_cast<std::size_t>(attributes.curve_offsets[part + 1]) - first - 1;
  const float along = u_along_curve(mesh, hit.primitive_index, hit.u) * static_cast<float>(spans);
  const std::size_t span = std::min(static_cast<std::size_t>(std::max(along, 0.0f)), spans - 1);
  const float u = along - static_cast<float>(span);
  return mixed(layer[first + span], 1.0f - u, layer[first + span + 1], u);
}

// None if the mesh lacks the layer of that number. Throws InvalidArgument for one that does not fit the mesh.
template <class T>
[[nodiscard]] std::optional<T> layer_at(const Appearance& appearance, const Instance& instance, const Hit& hit,
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

}  // namespace perfect_bvh
