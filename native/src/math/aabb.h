// Axis-aligned boxes. An empty box has lower = +inf, upper = -inf, so that growing it needs no special case.
#pragma once

#include <limits>

#include "math/vec3.h"

namespace perfect_bvh {

struct Aabb {
  Vec3f lower{kInfinity, kInfinity, kInfinity};
  Vec3f upper{-kInfinity, -kInfinity, -kInfinity};

  static constexpr float kInfinity = std::numeric_limits<float>::infinity();

  constexpr void grow(Vec3f point) noexcept { lower = min(lower, point), upper = max(upper, point); }
  constexpr void grow(const Aabb& box) noexcept { lower = min(lower, box.lower), upper = max(upper, box.upper); }
  [[nodiscard]] constexpr bool is_empty() const noexcept {
    return !(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z);
  }
  [[nodiscard]] constexpr Vec3f extent() const noexcept { return upper - lower; }
  // Half the surface area: the factor 2 cancels in every ratio. 0 for an empty box.
  [[nodiscard]] constexpr float half_area() const noexcept {
    if (is_empty()) return 0.0f;
    const Vec3f e = extent();
    return e.x * e.y + e.y * e.z + e.z * e.x;
  }
  [[nodiscard]] constexpr bool contains(const Aabb& box) const noexcept {
    return box.is_empty() || (lower.x <= box.lower.x && lower.y <= box.lower.y && lower.z <= box.lower.z &&
                              upper.x >= box.upper.x && upper.y >= box.upper.y && upper.z >= box.upper.z);
  }
};

}  // namespace perfect_bvh
