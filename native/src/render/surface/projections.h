// How images are laid on surfaces, as Blender's Image Texture and Environment Texture have it. In: an image, how it is
// projected, a place. Out: its colour there.
#pragma once

#include <cstdint>

#include "math/vec3.h"
#include "render/appearance/appearance.h"

namespace perfect_bvh {

// In the order of kNodeShapes. Spheres and tubes lie in a unit cube.
enum class ImageProjection : std::uint8_t { kFlat, kEquirectangular, kSphere, kTube };

[[nodiscard]] Rgba look_up_projected(const Texture& image, ImageProjection projection, Vec3f place) noexcept;

// From six sides of a box, by the normal in the object's space; `blend`, 0 to 1, is how much of it shows several sides.
[[nodiscard]] Rgba look_up_box(const Texture& image, Vec3f place, Vec3f normal, float blend) noexcept;

}  // namespace perfect_bvh
