// Gabor noise, like Blender's Gabor Texture: a sum of waves under Gaussians at random points. In: settings and a point.
// Out: the node's outputs.
//
// Lagae et al. 2009 ("Procedural Noise using Sparse Gabor Convolution"), with the equal numbers of points per cell and
// the weights of equal magnitude of Tavernier et al. 2019 ("Making Gabor Noise Fast and Normalized"), and the phase and
// intensity of Tricard et al. 2019 ("Procedural Phasor Noise").
#pragma once

#include "math/vec3.h"

namespace perfect_bvh {

struct GaborSettings {
  bool is_flat = true;  // only in x and y
  float scale = 5.0f, frequency = 2.0f;
  float anisotropy = 1.0f;              // 1: all waves have one direction, 0: random directions
  float angle = 0.785398f;              // of that direction if flat, in radians
  Vec3f orientation{1.0f, 1.0f, 0.0f};  // that direction otherwise; of any length
};

// Returns the value, the phase and the intensity, each about 0 to 1.
[[nodiscard]] Vec3f gabor_noise(const GaborSettings& settings, Vec3f p) noexcept;

}  // namespace perfect_bvh
