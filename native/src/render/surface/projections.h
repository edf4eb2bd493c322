// Projects images onto surfaces like Blender's Image Texture and Environment Texture. In: an image, its projection, a
// position. Out: its colour there.
#pragma once

#include <cstdint>

#include "math/vec3.h"
#include "render/appearance/appearance.h"

namespace perfect_bvh {

// In the order of kNodeShapes. Spheres and tubes are in a unit cube.
enum class ImageProjection : std::uint8_t { kFlat, kEquirectangular, kSphere, kTube };

[[nodiscard]] Rgba look_up_projected(const Texture& image, ImageProjection projection, Vec3f place) noexcept;

// Projects from six sides of a box, by the normal in the object's space. `blend`, 0 to 1, is the share that blends
// several sides.
[[nodiscard]] Rgba look_up_box(const Texture& image, Vec3f place, Vec3f normal, float blend) noexcept;

}  // namespace perfect_bvh
