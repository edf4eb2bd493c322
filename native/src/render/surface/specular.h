// Specular reflection: what surfaces mirror, and the highlights that lights leave on them (GGX).
// In: what a surface reflects, how rough it is, from where it is seen. Out: how much of a light it sends to the viewer,
// or in which direction it mirrors, and how much of what comes from there. Microfacets of the GGX distribution (Walter
// et al. 2007) with Smith's shadowing, Schlick's Fresnel term (1994); the directions are sampled by visible normals
// (Heitz 2018) as spherical caps (Dupuy and Benyoub 2023).
#pragma once

#include "math/vec3.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {

struct Specular {
  Vec3f reflectance{0, 0, 0};  // of a surface that is seen from straight above
  float roughness = 1.0f;
  Vec3f view{0, 0, 1};       // towards the viewer, unit length
  bool over_diffuse = true;  // whether it lies on anything that gives light back diffuse: on metals it does not

  [[nodiscard]] bool shines() const noexcept {
    return reflectance.x > 0.0f || reflectance.y > 0.0f || reflectance.z > 0.0f;
  }
  // Whether what it mirrors is worth a ray. What a rough plastic or stone mirrors cannot be seen.
  [[nodiscard]] bool mirrors() const noexcept;
};

// The share of light that is reflected, at this cosine between the normal and the way to the viewer.
[[nodiscard]] Vec3f reflected_share(const Specular& specular, float cosine) noexcept;

// How much is not reflected, and so is left for what lies below: of a rough surface that is more, as its facets are
// seen at all angles.
[[nodiscard]] float unreflected_share(const Specular& specular, float cosine) noexcept;

struct Highlight {
  Vec3f share{0, 0, 0};  // what a light adds to a surface's colour, in parts of LightRay::light
  float density = 0.0f;  // with which `mirrored` chooses the direction of the light, over solid angle
};
[[nodiscard]] Highlight highlight(const Specular& specular, Vec3f normal, Vec3f to_light) noexcept;

struct Mirrored {
  Vec3f direction{0, 0, 1};
  Vec3f weight{0, 0, 0};  // of what comes from there
  float density = 0.0f;   // of such directions, over solid angle
};
[[nodiscard]] Mirrored mirrored(const Specular& specular, Vec3f normal, Point2 random) noexcept;

}  // namespace perfect_bvh
