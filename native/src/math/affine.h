// Affine maps in double precision: instance transforms and their inverses.
#pragma once

#include <array>
#include <cmath>

#include "math/aabb.h"
#include "math/vec3.h"

namespace perfect_bvh {

// p -> (column x) p.x + (column y) p.y + (column z) p.z + translation.
struct Affine {
  Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  Vec3d translation{0, 0, 0};

  [[nodiscard]] constexpr Vec3d vector(Vec3d v) const noexcept { return x * v.x + y * v.y + z * v.z; }
  [[nodiscard]] constexpr Vec3d point(Vec3d p) const noexcept { return vector(p) + translation; }
  // The transpose of the linear part applied to v: with the inverse map this transforms normals.
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

// The inverse; its entries are not finite where the map flattens space.
[[nodiscard]] constexpr Affine inverse(const Affine& map) noexcept {
  const double scale = 1.0 / map.determinant();
  const Vec3d row0 = cross(map.y, map.z) * scale;
  const Vec3d row1 = cross(map.z, map.x) * scale;
  const Vec3d row2 = cross(map.x, map.y) * scale;
  Affine result{{row0.x, row1.x, row2.x}, {row0.y, row1.y, row2.y}, {row0.z, row1.z, row2.z}, {0, 0, 0}};
  result.translation = -result.vector(map.translation);
  return result;
}

// Rounds outward: the float box always contains the double one.
[[nodiscard]] inline float round_down(double value) noexcept {
  const auto rounded = static_cast<float>(value);
  return static_cast<double>(rounded) > value ? std::nextafter(rounded, -Aabb::kInfinity) : rounded;
}
[[nodiscard]] inline float round_up(double value) noexcept {
  const auto rounded = static_cast<float>(value);
  return static_cast<double>(rounded) < value ? std::nextafter(rounded, Aabb::kInfinity) : rounded;
}

}  // namespace perfect_bvh
