// The scale of the mode "cost": logarithmic, eight doublings from 2 (violet) to 512 (pale yellow), whatever the scene.
#pragma once

#include <algorithm>

#include "math/elementary.h"
#include "render/modes/palette.h"

namespace perfect_bvh {

inline constexpr float kLeastCost = 2.0f;
inline constexpr float kCostDoublings = 8.0f;

// cost: nodes visited plus triangles tested.
[[nodiscard]] inline Vec3f cost_color(const ColorRamp& ramp, float cost) noexcept {
  return ramp.at(static_cast<float>(logarithm2(static_cast<double>(std::max(cost, 1.0f) / kLeastCost))) /
                 kCostDoublings);
}

}  // namespace perfect_bvh
