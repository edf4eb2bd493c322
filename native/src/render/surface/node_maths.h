// Shader node operations on numbers, vectors and colours, with the results of Cycles: one function per node, with its
// modes in the order of kNodeShapes. Undefined results are 0. The bits are the same on every system
// (math/elementary.h).
#pragma once

#include <cstdint>

#include "math/vec3.h"

namespace perfect_bvh {

[[nodiscard]] float node_math(std::uint8_t mode, float a, float b, float c) noexcept;
// Dot products, distances and lengths are returned in every component.
[[nodiscard]] Vec3f node_vector_math(std::uint8_t mode, Vec3f a, Vec3f b, Vec3f c, float scale) noexcept;
// Blend modes; `share` is per component.
[[nodiscard]] Vec3f node_mix(std::uint8_t mode, Vec3f share, Vec3f a, Vec3f b) noexcept;
[[nodiscard]] Vec3f node_convert(std::uint8_t mode, Vec3f color) noexcept;
[[nodiscard]] Vec3f node_hue_saturation(float hue, float saturation, float value, float share, Vec3f color) noexcept;
[[nodiscard]] float node_map_range(std::uint8_t mode, float value, float from_min, float from_max, float to_min,
                                   float to_max, float steps) noexcept;
[[nodiscard]] Vec3f node_mapping(std::uint8_t mode, Vec3f v, Vec3f location, Vec3f rotation, Vec3f scale) noexcept;
[[nodiscard]] Vec3f node_vector_rotate(std::uint8_t mode, Vec3f v, Vec3f center, Vec3f axis, float angle,
                                       Vec3f rotation, bool inverts) noexcept;
// Returns the reflectance of a dielectric of the relative index `eta` at this cosine (Born and Wolf 1999, section 1.5).
[[nodiscard]] float node_fresnel(float cosine, float eta) noexcept;
[[nodiscard]] float node_facing(float cosine, float blend) noexcept;

[[nodiscard]] float luminance(Vec3f color) noexcept;

}  // namespace perfect_bvh
