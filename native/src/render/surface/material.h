// What a surface is made of where a ray hit it: what it gives back diffuse and what it mirrors, its own light, how much
// of it is there at all. In: a hit and the scene's appearance. Out: numbers, images looked up.
#pragma once

#include <optional>

#include "render/appearance/appearance.h"
#include "tlas/snapshot.h"
#include "traverse/ray.h"

namespace perfect_bvh {

struct Material {
  Vec3f color{0, 0, 0};        // the share of light that it gives back, diffuse
  Vec3f emission{0, 0, 0};     // radiance
  Vec3f reflectance{0, 0, 0};  // see Specular
  float roughness = 1.0f;
  float alpha = 1.0f;
  float transmission = 0.0f;  // of what is there, how much is clear as glass
  float holdout = 0.0f;       // of what is there, how much cuts a hole: it hides what is behind, and adds no alpha

  // What passes straight through: nothing is bent, for all that glass does.
  [[nodiscard]] float through() const noexcept { return 1.0f - alpha * (1.0f - transmission); }
  // What it adds to the image's alpha.
  [[nodiscard]] float shown() const noexcept { return 1.0f - through() - alpha * holdout; }
  // The same of light on its way to other surfaces: glass, which would bend it, throws half a shadow.
  [[nodiscard]] float lets_light_through() const noexcept { return 1.0f - alpha * (1.0f - 0.6f * transmission); }
  // As if it gave back diffuse what it mirrors: for light that bounced.
  [[nodiscard]] Vec3f matt_color() const noexcept { return color + reflectance * (1.0f - transmission); }
};

// Where in one of the mesh's uv maps a hit lies; none without that map.
[[nodiscard]] std::optional<Point2> uv_at(const Appearance& appearance, const Instance& instance, const Hit& hit,
                                          std::int32_t map = 0);

// `row` is the material's in the tables, or kNoMaterial.
[[nodiscard]] Material material_at(const Appearance& appearance, const Instance& instance, const Hit& hit,
                                   std::int32_t row);

}  // namespace perfect_bvh
