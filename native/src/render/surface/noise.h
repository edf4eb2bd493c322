// Fractal noise, like Blender's Noise Texture. In: settings and a point. Out: a number or a colour.
//
// Gradient noise by Perlin 2002 ("Improving Noise"), summed over octaves as by Musgrave in "Texturing and Modeling: A
// Procedural Approach" (third edition, chapter 16). Blender's roughness is the factor from octave to octave.
#pragma once

#include <cstdint>

#include "math/vec3.h"

namespace perfect_bvh {

enum class NoiseKind : std::uint8_t { kMultifractal, kRidgedMultifractal, kHybridMultifractal, kFbm, kHeteroTerrain };

struct NoiseSettings {
  int dimensions = 3;  // 1: w, 2: x and y, 3: x, y and z, 4: all
  NoiseKind kind = NoiseKind::kFbm;
  bool normalize = true;  // from -1 .. 1 to 0 .. 1; only for kFbm
  float scale = 5.0f, detail = 2.0f, roughness = 0.5f, lacunarity = 2.0f;
  float offset = 0.0f;  // kHybridMultifractal, kRidgedMultifractal, kHeteroTerrain
  float gain = 1.0f;    // kHybridMultifractal, kRidgedMultifractal
  float distortion = 0.0f;
};

[[nodiscard]] float noise_factor(const NoiseSettings& settings, Vec3f p, float w) noexcept;
// Costs three times as much. The red channel is the factor.
[[nodiscard]] Vec3f noise_color(const NoiseSettings& settings, Vec3f p, float w) noexcept;

}  // namespace perfect_bvh
