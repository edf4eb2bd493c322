// A denoiser that needs no other library: the noisy light of an image is averaged with that of pixels whose surface is
// alike, as the albedo and the normal of each pixel tell.
// In: scene-linear colours, and what guides it. Out: the same colours with less noise, in each pixel the same bits for
// any number of threads. Light is filtered apart from albedo, so that textures stay sharp, by an edge-avoiding a-trous
// wavelet (Dammertz et al. 2010, "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering")
// whose tolerance for other brightness follows from the noise that each neighbourhood shows (Schied et al. 2017,
// "Spatiotemporal Variance-Guided Filtering", its spatial half): what has no noise is left as it is.
#pragma once

#include <span>

#include "core/cancel.h"
#include "math/vec3.h"

namespace perfect_bvh {

// Rows of `width` pixels, the same number in each image. albedo and normal may be empty: then nothing is known of them.
struct JointFilterImages {
  int width = 0;
  int height = 0;
  std::span<const Vec3f> color;   // finite
  std::span<const Vec3f> albedo;  // finite; means of a pixel's samples, as is the normal
  std::span<const Vec3f> normal;  // finite; zero where there is no surface
  std::span<Vec3f> out;           // another memory than `color`
};

// At most `max_threads` threads of the shared pool, 0 for all. Throws Cancelled, and what the token's callback does.
void joint_filter(const JointFilterImages& images, int max_threads, CancelToken& cancel);

}  // namespace perfect_bvh
