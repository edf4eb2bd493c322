// Patterns of Blender's texture nodes without a fractal: Checker, Brick, Gradient, Magic, Wave and White Noise. In:
// settings and a point. Out: a number or a colour.
//
// The formulas match the nodes' images and values (Blender's manual, "Texture Nodes"). Points are shifted by a
// millionth where a cube's sides would coincide with a step of the pattern.
#pragma once

#include <cstdint>

#include "math/vec3.h"

namespace perfect_bvh {

// Returns 1 in the cells of the first colour, 0 in those of the second.
[[nodiscard]] float checker_factor(float scale, Vec3f p) noexcept;

struct BrickSettings {
  float offset = 0.5f;  // of every offset_frequency-th row, in bricks
  int offset_frequency = 2;
  float squash = 1.0f;  // width of bricks of every squash_frequency-th row
  int squash_frequency = 2;
  float scale = 5.0f, mortar_size = 0.02f, mortar_smooth = 0.1f, bias = 0.0f, brick_width = 0.5f, row_height = 0.25f;
};
struct BrickTexture {
  float mortar = 0.0f;  // the node's factor: 1 in mortar, 0 in a brick
  float tint = 0.0f;    // of the brick: 0 for the first colour, 1 for the second
};
[[nodiscard]] BrickTexture brick_texture(const BrickSettings& settings, Vec3f p) noexcept;

enum class GradientKind : std::uint8_t {
  kLinear,
  kQuadratic,
  kEasing,
  kDiagonal,
  kSpherical,
  kQuadraticSphere,
  kRadial
};
// Returns 0 to 1.
[[nodiscard]] float gradient_factor(GradientKind kind, Vec3f p) noexcept;

struct MagicSettings {
  int depth = 2;  // 0 to 10
  float scale = 5.0f, distortion = 1.0f;
};
// Returns three channels; the node's factor is their mean.
[[nodiscard]] Vec3f magic_color(const MagicSettings& settings, Vec3f p) noexcept;

enum class WaveKind : std::uint8_t { kBands, kRings };
enum class WaveDirection : std::uint8_t { kX, kY, kZ, kAll };  // kAll: diagonal bands, spherical rings
enum class WaveProfile : std::uint8_t { kSine, kSaw, kTriangle };
struct WaveSettings {
  WaveKind kind = WaveKind::kBands;
  WaveDirection direction = WaveDirection::kX;  // across bands, the axis of rings
  WaveProfile profile = WaveProfile::kSine;
  float scale = 5.0f, distortion = 0.0f, detail = 2.0f, detail_scale = 1.0f, detail_roughness = 0.5f;
  float phase = 0.0f;  // radians
};
// Returns 0 to 1.
[[nodiscard]] float wave_factor(const WaveSettings& settings, Vec3f p) noexcept;

// Return random numbers from 0 to 1, the same for points with the same bits. dimensions: as in NoiseSettings.
[[nodiscard]] float white_noise_value(int dimensions, Vec3f p, float w) noexcept;
// The red channel is the value.
[[nodiscard]] Vec3f white_noise_color(int dimensions, Vec3f p, float w) noexcept;

}  // namespace perfect_bvh
