// Sample points in [0, 1)^2, evenly distributed over the samples of a pixel and over the pixels of the image.
// In: a pixel, a dimension, a sample number. Out: a point that depends only on these and the seed, never on tiles or
// threads, so that an image can be rendered in any order and continued later.
// The sequence is Sobol's in two dimensions with nested uniform scrambling by hashing (Burley 2020, with Vegdahl's 2021
// hash); further dimensions are padded. Each pixel flips its digits by an offset from a scrambled Sobol sequence along
// a Z-order curve (Ahmed and Wonka 2020). Neighbours differ as much as possible, so that the error of a few samples
// looks like blue noise.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "math/elementary.h"
#include "math/vec3.h"

namespace perfect_bvh {

struct Point2 {
  float x, y;
};

// A point as binary fractions. Flipping the same digits of all points of a sequence keeps it equally even.
struct FixedPoint2 {
  std::uint32_t x, y;

  friend constexpr FixedPoint2 operator^(FixedPoint2 a, FixedPoint2 b) noexcept { return {a.x ^ b.x, a.y ^ b.y}; }
  // 24 bits: more would round up to 1.
  [[nodiscard]] constexpr Point2 to_unit() const noexcept {
    return {static_cast<float>(x >> 8) * 0x1p-24f, static_cast<float>(y >> 8) * 0x1p-24f};
  }
};

namespace sampling {

// A bijection of 32-bit words with good avalanche (two rounds of xor-shift and multiply; Wellons' constants).
constexpr std::uint32_t mix(std::uint32_t x) noexcept {
  x = (x ^ (x >> 16)) * 0x21f0aaadu;
  x = (x ^ (x >> 15)) * 0xd35a2d97u;
  return x ^ (x >> 15);
}

constexpr std::uint32_t reverse_bits(std::uint32_t x) noexcept {
  x = (x << 16) | (x >> 16);
  x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
  x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
  x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
  return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

// Owen's nested scrambling of a binary fraction whose bits are given in reverse: each bit of the result depends only on
// the lower ones.
constexpr std::uint32_t scramble_reversed(std::uint32_t x, std::uint32_t seed) noexcept {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return x;
}

// The second Sobol dimension's generator is Pascal's triangle modulo 2, a Kronecker power of ((1, 1), (0, 1)), which
// five shifts apply. Returns the reversed bits of the fraction.
constexpr std::uint32_t second_dimension_reversed(std::uint32_t index) noexcept {
  index ^= (index & 0xffff0000u) >> 16;
  index ^= (index & 0xff00ff00u) >> 8;
  index ^= (index & 0xf0f0f0f0u) >> 4;
  index ^= (index & 0xccccccccu) >> 2;
  index ^= (index & 0xaaaaaaaau) >> 1;
  return index;
}

// Returns point `index` of a scrambled (0, 2)-sequence; the order of the points is scrambled as well.
constexpr FixedPoint2 scrambled_sobol(std::uint32_t index, std::uint32_t seed) noexcept {
  const std::uint32_t shuffled = reverse_bits(scramble_reversed(reverse_bits(index), mix(seed ^ 0x68bc21ebu)));
  return {reverse_bits(scramble_reversed(shuffled, mix(seed ^ 0x02e5be93u))),
          reverse_bits(scramble_reversed(second_dimension_reversed(shuffled), mix(seed ^ 0x967a889bu)))};
}

// The position of a pixel along the Z-order curve; images are at most 65536 pixels wide and high.
constexpr std::uint32_t spread_bits(std::uint32_t x) noexcept {
  x = (x | (x << 8)) & 0x00ff00ffu;
  x = (x | (x << 4)) & 0x0f0f0f0fu;
  x = (x | (x << 2)) & 0x33333333u;
  return (x | (x << 1)) & 0x55555555u;
}
constexpr std::uint32_t z_order(std::uint32_t x, std::uint32_t y) noexcept {
  return spread_bits(x) | (spread_bits(y) << 1);
}

}  // namespace sampling

// Numbers for one use (a pair of dimensions) of the samples.
class Dimension {
 public:
  constexpr Dimension(std::uint32_t seed, std::uint32_t number) noexcept
      : seed_(sampling::mix(sampling::mix(seed) + number)) {}

  // The same for every pixel: compute it once per tile.
  [[nodiscard]] constexpr FixedPoint2 sample(std::uint32_t index) const noexcept {
    return sampling::scrambled_sobol(index, seed_);
  }
  // The same for every sample of a pixel.
  [[nodiscard]] constexpr FixedPoint2 offset(std::uint32_t z_order) const noexcept {
    return sampling::scrambled_sobol(z_order, seed_ ^ 0x9e3779b9u);
  }

 private:
  std::uint32_t seed_;
};

// Directions ----------------------------------------------------------------------------------------------------------
// Directions about an axis, for all modes that sample light.

// Two unit vectors that form a right-handed frame with the unit vector z (Duff et al. 2017).
struct Frame {
  Vec3f x, y, z;
  explicit Frame(Vec3f axis) noexcept : z(axis) {
    const float sign = std::copysign(1.0f, axis.z);
    const float a = -1.0f / (sign + axis.z), b = axis.x * axis.y * a;
    x = {1.0f + sign * axis.x * axis.x * a, sign * b, -sign * axis.x};
    y = {b, sign + axis.y * axis.y * a, -axis.y};
  }
  [[nodiscard]] Vec3f world(Vec3f v) const noexcept { return x * v.x + y * v.y + z * v.z; }
};

// Returns a frame about an axis, with x as near to another direction as possible, turned about the axis.
[[nodiscard]] inline Frame framed(Vec3f axis, Vec3f along, float turns = 0.0f) noexcept {
  Frame frame(axis);
  const Vec3f across = cross(axis, along);
  const float size = length(across);
  if (!(size > 1e-6f)) return frame;
  const Vec3f y = across * (1.0f / size), x = cross(y, axis);
  const auto [sine, cosine] = sine_cosine(2.0f * std::numbers::pi_v<float> * turns);
  frame.x = x * cosine + y * sine, frame.y = y * cosine - x * sine;
  return frame;
}

// Maps uniformly to the unit disk; equal areas stay together, so an even set of points stays even (Shirley and Chiu
// 1997).
[[nodiscard]] inline Point2 uniform_disk(Point2 uniform) noexcept {
  const float a = 2.0f * uniform.x - 1.0f, b = 2.0f * uniform.y - 1.0f;
  if (a == 0.0f && b == 0.0f) return {0.0f, 0.0f};
  constexpr float kQuarter = std::numbers::pi_v<float> / 4.0f;
  const bool wide = std::abs(a) > std::abs(b);
  const float radius = wide ? a : b;
  const float angle = wide ? kQuarter * (b / a) : 2.0f * kQuarter - kQuarter * (a / b);
  const auto [sine, cosine] = sine_cosine(angle);
  return {radius * cosine, radius * sine};
}

// Samples the hemisphere of a unit normal with a cosine distribution.
[[nodiscard]] inline Vec3f cosine_direction(Vec3f normal, Point2 uniform) noexcept {
  const Point2 flat = uniform_disk(uniform);
  const float height = std::sqrt(std::max(0.0f, 1.0f - flat.x * flat.x - flat.y * flat.y));
  return Frame(normal).world({flat.x, flat.y, height});
}

}  // namespace perfect_bvh
