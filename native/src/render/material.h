// What a surface is made of where a ray hit it: base colour, own light, how much of it is there at all.
// In: a hit and the scene's appearance. Out: numbers, images looked up.
#pragma once

#include <optional>

#include "render/appearance.h"
#include "scene/snapshot.h"
#include "traverse/ray.h"

namespace perfect_bvh {

struct Material {
  Vec3f color{0, 0, 0};     // the share of light that it gives back, matt
  Vec3f emission{0, 0, 0};  // radiance
  float alpha = 1.0f;
};

// Where in the mesh's uv map a hit lies; none without a map.
[[nodiscard]] std::optional<Point2> uv_at(const Appearance& appearance, const Instance& instance, const Hit& hit);

// `row` is the material's in the tables, or kNoMaterial.
[[nodiscard]] Material material_at(const Appearance& appearance, const Instance& instance, const Hit& hit,
                                   std::int32_t row);

}  // namespace perfect_bvh
