// What a surface is made of where a ray hit it, its own light, and how much of it is there at all.
// In: a hit and the scene's appearance. Out: numbers, images looked up.
#pragma once

#include <optional>

#include "render/appearance/appearance.h"
#include "tlas/snapshot.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// Shares of a surface: `metallic` is metal; of the rest `transmission` is clear; of the rest `translucency` scatters to
// the other side; what remains is diffuse below a dielectric reflection.
struct Material {
  Vec3f color{0, 0, 0};     // of the diffuse base
  Vec3f emission{0, 0, 0};  // radiance
  float roughness = 1.0f;   // of all that is not diffuse
  float metallic = 0.0f;
  Vec3f metal{1, 1, 1};          // what metal reflects seen from straight above
  float even_metal = 0.0f;       // how much of the metal reflects so at all angles
  float reflectance = 0.0f;      // of the dielectric, seen from straight above
  Vec3f specular_tint{1, 1, 1};  // of that reflection; of what metal reflects at 82 degrees
  float transmission = 0.0f;
  float ior = 1.5f;               // refractive index of what is clear
  Vec3f tint{1, 1, 1};            // of what passes into it
  float tinted_glass = 0.0f;      // how much of it tints what it reflects, too
  float plain_refraction = 0.0f;  // how much of it reflects nothing
  float lossy_facets = 0.0f;      // share of light that facets scatter at each other and that is lost
  float translucency = 0.0f;
  Vec3f translucent{0, 0, 0};  // of all the light that meets the surface, what is scattered to the other side
  float alpha = 1.0f;
  const Hair* hair = nullptr;  // what strands are of instead
  float surface = 1.0f;        // how much of the surface there is: on strands, beside hair
  float holdout = 0.0f;        // of what is there, how much cuts a hole: it hides what is behind, and adds no alpha

  // What passes by it, as if nothing was there.
  [[nodiscard]] float through() const noexcept { return 1.0f - alpha; }
  // What it adds to the image's alpha.
  [[nodiscard]] float shown() const noexcept { return alpha * (1.0f - holdout); }
};

// Where in one of the mesh's uv maps a hit lies; none without that map.
[[nodiscard]] std::optional<Point2> uv_at(const Appearance& appearance, const Instance& instance, const Hit& hit,
                                          std::int32_t map = 0);

// `row` is the material's in the tables, or kNoMaterial.
[[nodiscard]] Material material_at(const Appearance& appearance, const Instance& instance, const Hit& hit,
                                   std::int32_t row);

}  // namespace perfect_bvh
