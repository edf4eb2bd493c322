#include "render/surface/material.h"

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "math/elementary.h"
#include "mesh/round_mesh.h"
#include "render/surface/surface.h"

namespace perfect_bvh {

namespace {

constexpr float kPlainRoughness = 0.5f;

// What one of a mesh's layers, uvs or colours, has where a ray hit: between the corners of a triangle, and of curves
// and points either what a whole one has, or between the control points of a curve.
Vec3f mixed(Vec3f a, float share_a, Vec3f b, float share_b) noexcept { return a * share_a + b * share_b; }
Point2 mixed(Point2 a, float share_a, Point2 b, float share_b) noexcept {
  return {a.x * share_a + b.x * share_b, a.y * share_a + b.y * share_b};
}

// Of curves and points; the layer is known to fit.
template <class T>
T round_layer_at(const Mesh& mesh, const MeshAttributes& attributes, std::span<const T> layer,
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

}  // namespace

std::optional<Point2> uv_at(const Appearance& appearance, const Instance& instance, const Hit& hit, std::int32_t map) {
  return layer_at(appearance, instance, hit, &MeshAttributes::uv_maps, map);
}

namespace {

// Black where the mesh has no such colours, as in Blender.
Vec3f tint_at(const Appearance& appearance, const Instance& instance, const Hit& hit, std::int32_t tint) {
  const Vec3f black{0.0f, 0.0f, 0.0f};
  return layer_at(appearance, instance, hit, &MeshAttributes::corner_colors, tint).value_or(black);
}

// What a table without rows stands for is in the last two arguments.
Vec3f tinted(const TintTable& table, std::size_t row, Vec3f base, Vec3f color, float power) noexcept {
  if (!table.colors.empty()) color = table.colors[row];
  if (!table.powers.empty()) power = table.powers[row];
  if (power == 0.0f) return color;
  if (power == 1.0f) return color * base;
  const auto raised = [power](float channel) { return perfect_bvh::power(std::max(channel, 0.0f), power); };
  return color * Vec3f{raised(base.x), raised(base.y), raised(base.z)};
}

void set_scattering(const Appearance& appearance, std::size_t index, Material& material) {
  const auto set = [index]<class T>(std::span<const T> column, T& value) {
    if (!column.empty()) value = column[index];
  };
  set(appearance.metallics, material.metallic), set(appearance.roughnesses, material.roughness);
  set(appearance.lossy_facets, material.lossy_facets);
  set(appearance.reflectances, material.reflectance), set(appearance.specular_tints, material.specular_tint);
  set(appearance.transmissions, material.transmission), set(appearance.iors, material.ior);
  set(appearance.even_metals, material.even_metal), set(appearance.tinted_glasses, material.tinted_glass);
  set(appearance.plain_refractions, material.plain_refraction);
  set(appearance.translucencies, material.translucency);
  material.metal = tinted(appearance.metal_tints, index, material.color, {1, 1, 1}, 1.0f);
  if (material.transmission > 0.0f) {
    material.tint = tinted(appearance.transmission_tints, index, material.color, {1, 1, 1}, 0.5f);
  }
  material.translucent = tinted(appearance.translucent_tints, index, material.color, {0, 0, 0}, 0.0f);
}

void look_up_images(const Appearance& appearance, const Instance& instance, const Hit& hit, std::size_t index,
                    Material& material) {
  const auto image_in = [&](std::span<const std::int32_t> images) { return images.empty() ? kNoImage : images[index]; };
  const std::int32_t color_image = image_in(appearance.color_images), alpha_image = image_in(appearance.alpha_images);
  const std::int32_t emission_image = image_in(appearance.emission_images);
  if (color_image == kNoImage && alpha_image == kNoImage && emission_image == kNoImage) return;
  std::int32_t map = -1;
  Point2 uv{0.0f, 0.0f};
  const auto look = [&](std::int32_t image) {
    const Texture& texture = appearance.images[static_cast<std::size_t>(image)];
    if (texture.uv_map != map) {  // mostly all have the same one
      map = texture.uv_map;
      // Without the map everything shows the image's corner, as in Blender.
      uv = uv_at(appearance, instance, hit, map).value_or(Point2{0.0f, 0.0f});
    }
    return look_up_mapped(texture, uv.x, uv.y);
  };
  Rgba color;
  if (color_image != kNoImage) {
    color = look(color_image);
    material.color = {color.r, color.g, color.b};
    if (!appearance.color_scales.empty()) material.color = material.color * appearance.color_scales[index];
  }
  if (alpha_image != kNoImage) {
    if (alpha_image != color_image) color = look(alpha_image);
    material.alpha *= std::clamp(color.a, 0.0f, 1.0f);
  }
  if (emission_image != kNoImage) {
    color = look(emission_image);
    material.emission = material.emission * Vec3f{color.r, color.g, color.b};
  }
}

}  // namespace

Material material_at(const Appearance& appearance, const Instance& instance, const Hit& hit, std::int32_t row) {
  Material material;
  material.color = material_color(appearance, row);
  if (row == kNoMaterial) {
    material.reflectance = appearance.plain_reflectance, material.roughness = kPlainRoughness;
    return material;
  }
  const auto index = static_cast<std::size_t>(row);
  if (!appearance.base_colors.empty()) material.color = appearance.base_colors[index];
  if (!appearance.emissions.empty()) material.emission = appearance.emissions[index];
  if (!appearance.alphas.empty()) material.alpha = appearance.alphas[index];
  if (!appearance.material_holdouts.empty()) material.holdout = appearance.material_holdouts[index];
  look_up_images(appearance, instance, hit, index, material);
  if (const std::int32_t tint = appearance.tints.empty() ? kNoTint : appearance.tints[index]; tint != kNoTint) {
    material.color = material.color * tint_at(appearance, instance, hit, tint);
  }
  set_scattering(appearance, index, material);
  if (!appearance.hairs.empty() && appearance.hairs[index] != kNoHair) {
    material.hair = &appearance.hair_rows[static_cast<std::size_t>(appearance.hairs[index])];
  }
  return material;
}

}  // namespace perfect_bvh
