// What shader nodes do to numbers, vectors and colours, as Cycles does it: a function a node, its kinds by their places
// in kNodeShapes. What has no value is 0. The same bits on every system (math/elementary.h).
#pragma once

#include <cstdint>

#include "math/vec3.h"

namespace perfect_bvh {

[[nodiscard]] float node_math(std::uint8_t mode, float a, float b, float c) noexcept;
// Dot products, distances and lengths are in each component.
[[nodiscard]] Vec3f node_vector_math(std::uint8_t mode, Vec3f a, Vec3f b, Vec3f c, float scale) noexcept;
// Blend modes; `share` by component.
[[nodiscard]] Vec3f node_mix(std::uint8_t mode, Vec3f share, Vec3f a, Vec3f b) noexcept;
[[nodiscard]] Vec3f node_convert(std::uint8_t mode, Vec3f color) noexcept;
[[nodiscard]] Vec3f node_hue_saturation(float hue, float saturation, float value, float share, Vec3f color) noexcept;
[[nodiscard]] float node_map_range(std::uint8_t mode, float value, float from_min, float from_max, float to_min,
                                   float to_max, float steps) noexcept;
[[nodiscard]] Vec3f node_mapping(std::uint8_t mode, Vec3f v, Vec3f location, Vec3f rotation, Vec3f scale) noexcept;
[[nodiscard]] Vec3f node_vector_rotate(std::uint8_t mode, Vec3f v, Vec3f center, Vec3f axis, float angle,
                                       Vec3f rotation, bool inverts) noexcept;
// What a dielectric of the relative index `eta` reflects of light at this cosine (Born and Wolf 1999, section 1.5).
[[nodiscard]] float node_fresnel(float cosine, float eta) noexcept;
[[nodiscard]] float node_facing(float cosine, float blend) noexcept;

[[nodiscard]] float luminance(Vec3f color) noexcept;

}  // namespace perfect_bvh
