// Gabor noise, as Blender's Gabor Texture has it: a sum of waves under bells at random points. In: settings and a
// point. Out: the node's outputs.
//
// Lagae et al. 2009 ("Procedural Noise using Sparse Gabor Convolution"), with the equal numbers of points in cells and
// the weights of one size of Tavernier et al. 2019 ("Making Gabor Noise Fast and Normalized"), and the phase and the
// intensity of Tricard et al. 2019 ("Procedural Phasor Noise").
#pragma once

#include "math/vec3.h"

namespace perfect_bvh {

struct GaborSettings {
  bool is_flat = true;  // in x and y alone
  float scale = 5.0f, frequency = 2.0f;
  float anisotropy = 1.0f;              // 1: all waves run one way, 0: each its own
  float angle = 0.785398f;              // of that way where it is flat, in radians
  Vec3f orientation{1.0f, 1.0f, 0.0f};  // elsewhere; of any length
};

// The value, the phase and the intensity, about 0 to 1 each.
[[nodiscard]] Vec3f gabor_noise(const GaborSettings& settings, Vec3f p) noexcept;

}  // namespace perfect_bvh
