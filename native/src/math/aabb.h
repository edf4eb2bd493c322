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

// Half the surface area of a box of this size, in double: where many are added up, neither large nor many small boxes
// lose their share.
[[nodiscard]] constexpr double half_area(Vec3d size) noexcept {
  return size.x * size.y + size.y * size.z + size.z * size.x;
}
// Not of an empty box.
[[nodiscard]] constexpr double half_area(const Aabb& box) noexcept {
  return half_area(to_double(box.upper) - to_double(box.lower));
}
// Of what lies in both boxes; 0 if they do not meet.
[[nodiscard]] constexpr double shared_half_area(const Aabb& a, const Aabb& b) noexcept {
  const Aabb shared{max(a.lower, b.lower), min(a.upper, b.upper)};
  return shared.is_empty() ? 0.0 : half_area(shared);
}

}  // namespace perfect_bvh
