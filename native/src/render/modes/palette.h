// Colours for numbers: distinct ones for ids, an even ramp for amounts.
// Both are laid out in Oklab (Ottosson 2020), where equal steps look equal, and handed out encoded for the screen
// (sRGB): they are codes, to be shown and stored as they are.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "math/elementary.h"
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

// The scale of the mode "cost": logarithmic, eight doublings from 2 (violet) to 512 (pale yellow), whatever the scene.
inline constexpr float kLeastCost = 2.0f;
inline constexpr float kCostDoublings = 8.0f;

// cost: nodes visited plus triangles tested.
[[nodiscard]] inline Vec3f cost_color(const ColorRamp& ramp, float cost) noexcept {
  return ramp.at(static_cast<float>(logarithm2(static_cast<double>(std::max(cost, 1.0f) / kLeastCost))) /
                 kCostDoublings);
}

}  // namespace perfect_bvh
