// Points of one to four dimensions at which textures are evaluated, and hashes of them.
//
// Textures of noise and cells are patterns of random numbers, so they only equal Blender's with the same hashes:
// Jenkins' lookup3 (2006) of the bits of floats and integers, and the permuted congruential generators of Jarzynski and
// Olano 2020 ("Hash Functions for GPU Rendering") of the integer coordinates of cells.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "math/vec3.h"

namespace perfect_bvh {

// Points --------------------------------------------------------------------------------------------------------------

template <std::size_t N>
using Coordinates = std::array<float, N>;
template <std::size_t N>
using Words = std::array<std::uint32_t, N>;

// Scales the coordinates of an N-dimensional texture: (w), (x, y), (x, y, z) or (x, y, z, w).
template <std::size_t N>
[[nodiscard]] constexpr Coordinates<N> coordinates_of(Vec3f p, float w, float scale) noexcept {
  if constexpr (N == 1) return {w * scale};
  if constexpr (N == 2) return {p.x * scale, p.y * scale};
  if constexpr (N == 3) return {p.x * scale, p.y * scale, p.z * scale};
  if constexpr (N == 4) return {p.x * scale, p.y * scale, p.z * scale, w * scale};
}

// Makes an array of body(0), body(1) ...
template <std::size_t N, class Body>
[[nodiscard]] constexpr auto each_axis(const Body& body) noexcept {
  std::array<decltype(body(std::size_t{0})), N> made{};
  for (std::size_t i = 0; i < N; ++i) made[i] = body(i);
  return made;
}

template <std::size_t N>
[[nodiscard]] constexpr Coordinates<N> operator+(const Coordinates<N>& a, const Coordinates<N>& b) noexcept {
  return each_axis<N>([&](std::size_t i) { return a[i] + b[i]; });
}
template <std::size_t N>
[[nodiscard]] constexpr Coordinates<N> operator-(const Coordinates<N>& a, const Coordinates<N>& b) noexcept {
  return each_axis<N>([&](std::size_t i) { return a[i] - b[i]; });
}
template <std::size_t N>
[[nodiscard]] constexpr Coordinates<N> operator*(const Coordinates<N>& a, float factor) noexcept {
  return each_axis<N>([&](std::size_t i) { return a[i] * factor; });
}
template <std::size_t N>
[[nodiscard]] constexpr Coordinates<N> operator/(const Coordinates<N>& a, float divisor) noexcept {
  return each_axis<N>([&](std::size_t i) { return a[i] / divisor; });
}
template <std::size_t N>
[[nodiscard]] constexpr float inner(const Coordinates<N>& a, const Coordinates<N>& b) noexcept {
  float sum = 0.0f;
  for (std::size_t i = 0; i < N; ++i) sum += a[i] * b[i];
  return sum;
}
// Calls body with the constant 1, 2, 3 or 4.
template <class Body>
[[nodiscard]] auto with_dimensions(int dimensions, const Body& body) noexcept {
  if (dimensions <= 1) return body(std::integral_constant<std::size_t, 1>{});
  if (dimensions == 2) return body(std::integral_constant<std::size_t, 2>{});
  if (dimensions == 3) return body(std::integral_constant<std::size_t, 3>{});
  return body(std::integral_constant<std::size_t, 4>{});
}

// Returns `low` for NaN, which std::clamp would return unchanged and which converts to an undefined integer.
[[nodiscard]] constexpr float clamped(float x, float low, float high) noexcept {
  return x > low ? (x < high ? x : high) : low;
}

// Returns b if t is 1.
[[nodiscard]] constexpr float mix(float a, float b, float t) noexcept { return a * (1.0f - t) + b * t; }
[[nodiscard]] constexpr Vec3f mix(Vec3f a, Vec3f b, float t) noexcept { return a * (1.0f - t) + b * t; }

template <std::size_t N>
[[nodiscard]] constexpr Coordinates<N> mix(const Coordinates<N>& a, const Coordinates<N>& b, float t) noexcept {
  return a * (1.0f - t) + b * t;
}

// Returns a * b + c with the product unrounded, like fused instructions, which Cycles uses here: if c is large, the
// last bit of the sum is more than a thousandth of a texture's value. The bits are the same on every processor.
[[nodiscard]] constexpr float multiply_add(float a, float b, float c) noexcept {
  return static_cast<float>(static_cast<double>(a) * static_cast<double>(b) + static_cast<double>(c));
}

// Hashes --------------------------------------------------------------------------------------------------------------

// Hashes up to four words by lookup3: three are added to the state, which is mixed before the fourth is added.
template <std::size_t N>
[[nodiscard]] constexpr std::uint32_t lookup3(const Words<N>& words) noexcept {
  static_assert(N >= 1 && N <= 4);
  constexpr std::uint32_t kBegin = 0xdeadbeefu + 4u * N + 13u;
  std::uint32_t a = kBegin + words[0], b = kBegin, c = kBegin;
  if constexpr (N > 1) b += words[1];
  if constexpr (N > 2) c += words[2];
  if constexpr (N > 3) {
    const auto stir = [](std::uint32_t& target, std::uint32_t& source, std::uint32_t third, int turn) {
      target = (target - source) ^ std::rotl(source, turn);
      source += third;
    };
    stir(a, c, b, 4), stir(b, a, c, 6), stir(c, b, a, 8);
    stir(a, c, b, 16), stir(b, a, c, 19), stir(c, b, a, 4);
    a += words[3];
  }
  const auto finish = [](std::uint32_t& target, std::uint32_t source, int turn) {
    target = (target ^ source) - std::rotl(source, turn);
  };
  finish(c, b, 14), finish(a, c, 11), finish(b, a, 25), finish(c, b, 16);
  finish(a, c, 4), finish(b, a, 14), finish(c, b, 24);
  return c;
}

// Hashes floats to a number from 0 to 1.
template <class... Floats>
[[nodiscard]] constexpr float random_of(Floats... values) noexcept {
  return static_cast<float>(lookup3(Words<sizeof...(Floats)>{std::bit_cast<std::uint32_t>(values)...})) * 0x1p-32f;
}

// Hashes a point to numbers from 0 to 1.
template <std::size_t N>
[[nodiscard]] constexpr Vec3f random_color(const Coordinates<N>& p) noexcept {
  if constexpr (N == 1) return {random_of(p[0]), random_of(p[0], 1.0f), random_of(p[0], 2.0f)};
  if constexpr (N == 2) return {random_of(p[0], p[1]), random_of(p[0], p[1], 1.0f), random_of(p[0], p[1], 2.0f)};
  if constexpr (N == 3)
    return {random_of(p[0], p[1], p[2]), random_of(p[0], p[1], p[2], 1.0f), random_of(p[0], p[1], p[2], 2.0f)};
  if constexpr (N == 4)
    return {random_of(p[0], p[1], p[2], p[3]), random_of(p[2], p[0], p[3], p[1]), random_of(p[3], p[2], p[1], p[0])};
}

// Hashes an integer point of two to four dimensions to numbers from 0 to 1, by "pcg2d", "pcg3d" and "pcg4d" of the
// paper, but shifting signed words.
template <std::size_t N>
[[nodiscard]] constexpr Coordinates<N> random_of_cell(const std::array<std::int32_t, N>& cell) noexcept {
  static_assert(N >= 2 && N <= 4);
  constexpr std::uint32_t kFactor = 1664525u, kStep = 1013904223u;
  Words<N> v = each_axis<N>([&](std::size_t i) { return static_cast<std::uint32_t>(cell[i]) * kFactor + kStep; });
  const auto stir = [&v] {
    for (std::size_t i = 0; i < N; ++i) {
      // For three words, the other two; for four, those of the paper.
      if constexpr (N == 2) v[i] += v[1 - i] * kFactor;
      if constexpr (N == 3) v[i] += v[(i + 1) % 3] * v[(i + 2) % 3];
      if constexpr (N == 4) v[i] += i == 0 ? v[1] * v[3] : i == 3 ? v[1] * v[2] : v[(i + 1) % 3] * v[(i + 2) % 3];
    }
  };
  stir();
  for (std::uint32_t& word : v) word ^= static_cast<std::uint32_t>(static_cast<std::int32_t>(word) >> 16);
  stir();
  return each_axis<N>([&](std::size_t i) { return static_cast<float>(v[i] & 0x7fffffffu) * 0x1p-31f; });
}

}  // namespace perfect_bvh
