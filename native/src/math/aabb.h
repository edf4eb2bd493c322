// Axis-aligned boxes. An empty box has lower = +inf, upper = -inf, so that growing it needs no special case.
#pragma once

#include <array>
#include <cmath>
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

// Returns half the surface area of a box of this size, in double: in sums of many areas, neither large nor many small
// boxes lose their share.
[[nodiscard]] constexpr double half_area(Vec3d size) noexcept {
  return size.x * size.y + size.y * size.z + size.z * size.x;
}
// The box must not be empty.
[[nodiscard]] constexpr double half_area(const Aabb& box) noexcept {
  return half_area(to_double(box.upper) - to_double(box.lower));
}
// Returns half the surface area of the intersection of both boxes; 0 if they do not overlap.
[[nodiscard]] constexpr double shared_half_area(const Aabb& a, const Aabb& b) noexcept {
  const Aabb shared{max(a.lower, b.lower), min(a.upper, b.upper)};
  return shared.is_empty() ? 0.0 : half_area(shared);
}

// Affine --------------------------------------------------------------------------------------------------------------
// Affine maps in double precision: instance transforms and their inverses.

// p -> (column x) p.x + (column y) p.y + (column z) p.z + translation.
struct Affine {
  Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  Vec3d translation{0, 0, 0};

  [[nodiscard]] constexpr Vec3d vector(Vec3d v) const noexcept { return x * v.x + y * v.y + z * v.z; }
  [[nodiscard]] constexpr Vec3d point(Vec3d p) const noexcept { return vector(p) + translation; }
  // Applies the transpose of the linear part to v. The inverse map's transpose transforms normals.
  [[nodiscard]] constexpr Vec3d transposed_vector(Vec3d v) const noexcept { return {dot(x, v), dot(y, v), dot(z, v)}; }
  [[nodiscard]] constexpr double determinant() const noexcept { return dot(x, cross(y, z)); }
  [[nodiscard]] bool is_finite() const noexcept {
    return perfect_bvh::is_finite(x) && perfect_bvh::is_finite(y) && perfect_bvh::is_finite(z) &&
           perfect_bvh::is_finite(translation);
  }
  friend constexpr bool operator==(const Affine& a, const Affine& b) noexcept {
    return a.x == b.x && a.y == b.y && a.z == b.z && a.translation == b.translation;
  }
};

// Returns the inverse. Its entries are not finite if the map flattens space.
[[nodiscard]] constexpr Affine inverse(const Affine& map) noexcept {
  const double scale = 1.0 / map.determinant();
  const Vec3d row0 = cross(map.y, map.z) * scale;
  const Vec3d row1 = cross(map.z, map.x) * scale;
  const Vec3d row2 = cross(map.x, map.y) * scale;
  Affine result{{row0.x, row1.x, row2.x}, {row0.y, row1.y, row2.y}, {row0.z, row1.z, row2.z}, {0, 0, 0}};
  result.translation = -result.vector(map.translation);
  return result;
}

// Rounds outward, so that the float box always contains the double one.
[[nodiscard]] inline float round_down(double value) noexcept {
  const auto rounded = static_cast<float>(value);
  return static_cast<double>(rounded) > value ? std::nextafter(rounded, -Aabb::kInfinity) : rounded;
}
[[nodiscard]] inline float round_up(double value) noexcept {
  const auto rounded = static_cast<float>(value);
  return static_cast<double>(rounded) < value ? std::nextafter(rounded, Aabb::kInfinity) : rounded;
}

}  // namespace perfect_bvh
