// Three-component vectors. Plain aggregates: the same bytes as three packed numbers.
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace perfect_bvh {

template <class T>
struct Vec3 {
  T x, y, z;

  constexpr T& operator[](int axis) noexcept { return axis == 0 ? x : axis == 1 ? y : z; }
  constexpr T operator[](int axis) const noexcept { return axis == 0 ? x : axis == 1 ? y : z; }

  friend constexpr Vec3 operator+(Vec3 a, Vec3 b) noexcept { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend constexpr Vec3 operator-(Vec3 a, Vec3 b) noexcept { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend constexpr Vec3 operator-(Vec3 a) noexcept { return {-a.x, -a.y, -a.z}; }
  friend constexpr Vec3 operator*(Vec3 a, Vec3 b) noexcept { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  friend constexpr Vec3 operator*(Vec3 a, T s) noexcept { return {a.x * s, a.y * s, a.z * s}; }
  friend constexpr Vec3 operator*(T s, Vec3 a) noexcept { return a * s; }
  friend constexpr bool operator==(Vec3 a, Vec3 b) noexcept { return a.x == b.x && a.y == b.y && a.z == b.z; }
};

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;

template <class T>
constexpr T dot(Vec3<T> a, Vec3<T> b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
constexpr Vec3<T> cross(Vec3<T> a, Vec3<T> b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
T length(Vec3<T> a) noexcept {
  return std::sqrt(dot(a, a));
}
// The zero vector stays zero.
template <class T>
Vec3<T> normalized(Vec3<T> a) noexcept {
  const T size = length(a);
  return size > T(0) ? a * (T(1) / size) : a;
}
template <class T>
constexpr Vec3<T> min(Vec3<T> a, Vec3<T> b) noexcept {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}
template <class T>
constexpr Vec3<T> max(Vec3<T> a, Vec3<T> b) noexcept {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}
template <class T>
bool is_finite(Vec3<T> a) noexcept {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}
constexpr Vec3f to_float(Vec3d a) noexcept {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}
constexpr Vec3d to_double(Vec3f a) noexcept { return {a.x, a.y, a.z}; }

// Axes ----------------------------------------------------------------------------------------------------------------
// A loop over the three axes with constant numbers.

// Calls body(axis) with the constants 0, 1 and 2, so that components of vectors are accessed without a branch.
template <class Body>
constexpr void for_each_axis(const Body& body) {
  body(std::integral_constant<int, 0>{});
  body(std::integral_constant<int, 1>{});
  body(std::integral_constant<int, 2>{});
}

}  // namespace perfect_bvh
