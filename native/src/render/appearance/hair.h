// What strands of hair are made of: the rows of a table that materials refer to.
#pragma once

#include <cstdint>

#include "math/vec3.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {

inline constexpr std::int32_t kNoHair = -1;

// How wide the lobes of a fiber are for its roughness: by the fits of Chiang et al. 2016, or as those of a rough
// dielectric cylinder (Huang et al. 2022).
enum class FiberModel : std::uint8_t { kChiang, kHuang };
inline constexpr int kFiberModels = 2;

// A lobe of Blender's Hair BSDF.
struct HairLobe {
  Vec3f color{0, 0, 0};               // how much of all the light that meets the strand is scattered
  float along = 0.1f, across = 0.1f;  // roughnesses
  float offset = 0.0f;                // in radians, of the lobe's axis along the strand
};

// A strand is made of shares: of a fiber that light passes into, of two lobes, and of an ordinary surface.
struct Hair {
  float surface = 0.0f, fiber = 0.0f;
  FiberModel model = FiberModel::kChiang;
  Vec3f absorption{0, 0, 0};  // by the fiber's radius
  // The material's base colour, as images and tints make it, absorbs light, too, and tints the lobes.
  bool colored = false;
  float roughness = 0.3f, radial_roughness = 0.3f;  // along the strand and around it, 0 to 1, as in Blender
  float coat = 0.0f;                                // how much of the roughness the first reflection is without
  float tilt = 0.0f;                                // of the cuticle's scales, in radians
  float ior = 1.55f;
  float way = 1.0f;      // through it, as a share of that through a round one
  Vec3f lobes{1, 1, 1};  // what the reflection and the ways through, without and with one reflection, are multiplied by
  HairLobe reflection, transmission;
};

}  // namespace perfect_bvh
