// Directions about an axis: what every mode that samples light is made of.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/elementary.h"
#include "math/vec3.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {

// Two unit vectors that make a right-handed frame with the unit vector z (Duff et al. 2017).
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

// Uniform over the unit disk; equal areas stay together, so an even set of points stays even (Shirley and Chiu 1997).
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

// Spread like the cosine over the hemisphere of a unit normal.
[[nodiscard]] inline Vec3f cosine_direction(Vec3f normal, Point2 uniform) noexcept {
  const Point2 flat = uniform_disk(uniform);
  const float height = std::sqrt(std::max(0.0f, 1.0f - flat.x * flat.x - flat.y * flat.y));
  return Frame(normal).world({flat.x, flat.y, height});
}

}  // namespace perfect_bvh
