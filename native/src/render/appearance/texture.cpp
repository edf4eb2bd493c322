#include "render/appearance/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "math/elementary.h"

namespace perfect_bvh {
namespace {

// IEC 61966-2-1.
float linear_of(int byte) noexcept {
  const float value = static_cast<float>(byte) / 255.0f;
  return value <= 0.04045f ? value / 12.92f : power((value + 0.055f) / 1.055f, 2.4f);
}

const std::array<float, 256>& linear_values() noexcept {
  static const std::array<float, 256> values = [] {
    std::array<float, 256> made{};
    for (int byte = 0; byte < 256; ++byte) made[static_cast<std::size_t>(byte)] = linear_of(byte);
    return made;
  }();
  return values;
}

// A pixel's number along one side; -1 outside a clipped image.
int place(int number, int count, Extension extension) noexcept {
  if (number >= 0 && number < count) return number;
  if (extension == Extension::kClip) return -1;
  if (extension == Extension::kExtend) return number < 0 ? 0 : count - 1;
  const int rest = number % count;
  return rest < 0 ? rest + count : rest;
}

// Of a value between bytes, which is sRGB as in Cycles: within 6e-6, and exact where it is one.
float linear_between(float value) noexcept {
  const auto& linear = linear_values();
  const int byte = std::min(static_cast<int>(value), 254);
  const float low = linear[static_cast<std::size_t>(byte)], high = linear[static_cast<std::size_t>(byte) + 1];
  return low + (high - low) * (value - static_cast<float>(byte));
}

// As it is stored.
Rgba pixel_of(const Texture& texture, int x, int y) noexcept {
  const std::size_t first =
      4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(texture.width) + static_cast<std::size_t>(x));
  if (texture.floats != nullptr) {
    const float* const pixel = texture.floats + first;
    return {pixel[0], pixel[1], pixel[2], pixel[3]};
  }
  const std::uint8_t* const pixel = texture.bytes + first;
  return {static_cast<float>(pixel[0]), static_cast<float>(pixel[1]), static_cast<float>(pixel[2]),
          static_cast<float>(pixel[3])};
}

Rgba pixel_at(const Texture& texture, Extension extension, int x, int y) noexcept {
  x = place(x, texture.width, extension), y = place(y, texture.height, extension);
  return x < 0 || y < 0 ? Rgba{} : pixel_of(texture, x, y);
}

Rgba mixed(const Rgba& a, const Rgba& b, float share) noexcept {
  return {a.r + (b.r - a.r) * share, a.g + (b.g - a.g) * share, a.b + (b.b - a.b) * share, a.a + (b.a - a.a) * share};
}

// A coordinate in pixels, kept where an integer can hold it; what is not a number is 0.
float in_pixels(float coordinate, int count, Extension extension) noexcept {
  if (!std::isfinite(coordinate)) return 0.0f;
  if (extension == Extension::kRepeat) coordinate -= std::floor(coordinate);
  return std::clamp(coordinate, -2.0f, 3.0f) * static_cast<float>(count) - 0.5f;
}

Rgba look_up(const Texture& texture, Extension extension, float u, float v) noexcept {
  if (texture.width == 0 || texture.height == 0) return {};
  const float x = in_pixels(u, texture.width, extension);
  const float y = in_pixels(v, texture.height, extension);
  const float left = std::floor(x), below = std::floor(y);
  const int column = static_cast<int>(left), row = static_cast<int>(below);
  const auto pixel = [&](int right, int above) { return pixel_at(texture, extension, column + right, row + above); };
  const Rgba lower = mixed(pixel(0, 0), pixel(1, 0), x - left);
  const Rgba upper = mixed(pixel(0, 1), pixel(1, 1), x - left);
  const Rgba found = mixed(lower, upper, y - below);
  if (texture.floats != nullptr) return found;
  return {linear_between(found.r), linear_between(found.g), linear_between(found.b), found.a / 255.0f};
}

constexpr Rgba kMissingTile{1.0f, 0.0f, 1.0f, 1.0f};

// As in Cycles what lies less than a unit to the left of all tiles, or below them, belongs to the first ones.
Rgba look_up_tile(const TextureTiles& tiles, float u, float v) noexcept {
  const auto rows = static_cast<float>(tiles.rows.size() / TextureTiles::kColumns);
  if (!(u > -1.0f && u < TextureTiles::kColumns && v > -1.0f && v < rows)) return kMissingTile;
  const int column = static_cast<int>(u), row = static_cast<int>(v);
  const std::int32_t image = tiles.rows[static_cast<std::size_t>(row * TextureTiles::kColumns + column)];
  if (image < 0) return kMissingTile;
  const Texture& tile = tiles.images[static_cast<std::size_t>(image)];
  return look_up(tile, tile.extension, u - static_cast<float>(column), v - static_cast<float>(row));
}

}  // namespace

std::span<const Rgba> row_of_pixels(const Texture& texture, int y, std::vector<Rgba>& buffer) {
  const auto width = static_cast<std::size_t>(texture.width);
  const std::size_t first = 4 * static_cast<std::size_t>(y) * width;
  if (texture.floats != nullptr) return {reinterpret_cast<const Rgba*>(texture.floats + first), width};
  buffer.resize(width);
  const auto& linear = linear_values();
  for (std::size_t x = 0; x < width; ++x) {
    const std::uint8_t* const pixel = texture.bytes + first + 4 * x;
    buffer[x] = {linear[pixel[0]], linear[pixel[1]], linear[pixel[2]], static_cast<float>(pixel[3]) / 255.0f};
  }
  return buffer;
}

Rgba look_up(const Texture& texture, float u, float v) noexcept { return look_up(texture, texture.extension, u, v); }

Rgba look_up_mapped(const Texture& texture, float u, float v) noexcept {
  const Vec3f place{u, v, 1.0f};
  const float across = dot(texture.across, place), up = dot(texture.up, place);
  return texture.tiles ? look_up_tile(*texture.tiles, across, up) : look_up(texture, across, up);
}

Point2 place_around(Vec3f direction) noexcept {
  constexpr double kPi = std::numbers::pi;
  const double x = static_cast<double>(direction.x), y = static_cast<double>(direction.y);
  const double around = arc_tangent(y, x),
               above = arc_tangent(static_cast<double>(direction.z), std::sqrt(x * x + y * y));
  return {static_cast<float>(0.5 - around / (2.0 * kPi)), static_cast<float>(above / kPi + 0.5)};
}

Vec3f look_up_around(const Texture& texture, Vec3f direction) noexcept {
  const Point2 at = place_around(direction);
  // Over the poles the image does not repeat.
  const float border = 0.5f / static_cast<float>(std::max(texture.height, 1));
  const Rgba color = look_up(texture, Extension::kRepeat, at.x, std::clamp(at.y, border, 1.0f - border));
  return {color.r, color.g, color.b};
}

}  // namespace perfect_bvh
