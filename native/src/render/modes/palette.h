// Colours for numbers: distinct ones for ids, an even ramp for amounts.
// Both are laid out in Oklab (Ottosson 2020), where equal steps look equal, and handed out encoded for the screen
// (sRGB): they are codes, to be shown and stored as they are.
#pragma once

#include <array>
#include <cstdint>

#include "math/vec3.h"

namespace perfect_bvh {

// From Oklab's lightness (0..1), chroma and hue (in turns), with as much of the chroma as the screen can show.
[[nodiscard]] Vec3f color_from_lch(double lightness, double chroma, double hue) noexcept;

// The same colour for the same id, always; neighbouring ids look unlike.
[[nodiscard]] Vec3f id_color(std::uint32_t id) noexcept;

// From deep violet (0) through red and orange to pale yellow (1), its lightness rising evenly.
class ColorRamp {
 public:
  ColorRamp();
  [[nodiscard]] Vec3f at(float amount) const noexcept;

 private:
  static constexpr int kCells = 128;
  std::array<Vec3f, kCells + 1> colors_;
};

}  // namespace perfect_bvh
