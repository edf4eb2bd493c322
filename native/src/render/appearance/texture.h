// Images on surfaces and around the scene: bilinear lookup in the caller's pixels.
// In: an image and a place in it. Out: scene-linear colour and alpha.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "math/vec3.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {

// A colour with alpha: a row of the caller's arrays.
struct Rgba {
  float r = 0.0f, g = 0.0f, b = 0.0f, a = 0.0f;
};
static_assert(sizeof(Rgba) == 16);

// What lies outside 0..1: the image again, its border's colour, nothing.
enum class Extension : std::uint8_t { kRepeat, kExtend, kClip };

struct TextureTiles;

// A view of an image whose first row is at v = 0, the lower border. Exactly one of the pointers is set.
struct Texture {
  const std::uint8_t* bytes = nullptr;  // four a pixel: sRGB, alpha as it is
  const float* floats = nullptr;        // four a pixel: scene-linear
  int width = 0, height = 0;
  Extension extension = Extension::kRepeat;
  // Where a place (u, v, 1) of a uv map lies in the image.
  Vec3f across{1, 0, 0}, up{0, 1, 0};
  std::int32_t uv_map = 0;                    // which of a mesh's
  std::shared_ptr<const TextureTiles> tiles;  // if there are any, surfaces show those
};

// A UDIM image: one image for each unit square of a uv map, ten squares a row.
struct TextureTiles {
  static constexpr int kColumns = 10;
  std::vector<Texture> images;
  std::vector<std::int32_t> rows;  // of the images, square by square; -1 where there is none
};

// Alpha is straight: it does not darken the colour. Without colour and alpha where a clipped image ends.
[[nodiscard]] Rgba look_up(const Texture& texture, float u, float v) noexcept;

// The same, of a surface's place in its uv map. Magenta where a tile is missing, as in Cycles.
[[nodiscard]] Rgba look_up_mapped(const Texture& texture, float u, float v) noexcept;

// The pixels of a row of the image. Lies in `buffer` where they are not kept as such colours.
[[nodiscard]] std::span<const Rgba> row_of_pixels(const Texture& texture, int y, std::vector<Rgba>& buffer);

// Where an equirectangular image that Blender lays round a scene has a direction: (u, v), 0 to 1.
[[nodiscard]] Point2 place_around(Vec3f direction) noexcept;

// The colour that comes from there.
[[nodiscard]] Vec3f look_up_around(const Texture& texture, Vec3f direction) noexcept;

}  // namespace perfect_bvh
