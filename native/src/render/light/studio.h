// The light of a photographer's studio, for modes that show form rather than the scene's own lights: a wide soft sky
// over a dimmer ground, one soft key light from the upper left of the camera, and a quiet backdrop.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/elementary.h"
#include "render/sampling/camera.h"

namespace perfect_bvh {

struct Studio {
  Vec3f key_direction{0, 0, 1};  // towards the light, world space, unit length

  // Radiance from above and below; between them it is linear in the height of the direction.
  static constexpr Vec3f kSky{0.47f, 0.50f, 0.55f};
  static constexpr Vec3f kGround{0.23f, 0.215f, 0.20f};
  static constexpr Vec3f kKey{0.66f, 0.62f, 0.565f};  // irradiance over pi of a surface that faces it
  static constexpr float kKeyRadius = 0.22f;          // tangent of the light's angular radius

  explicit Studio(const RayMaker& camera) noexcept {
    const Vec3d towards = camera.right() * -0.55 + camera.up() * 0.25 + camera.axis() * -0.45 + Vec3d{0, 0, 0.8};
    key_direction = to_float(normalized(towards));
  }

  [[nodiscard]] static constexpr Vec3f dome(float height) noexcept {
    const float part = 0.5f + 0.5f * height;
    return kGround * (1.0f - part) + kSky * part;
  }
  // Returns the light on a surface with this normal height from the whole dome, over pi: the cosine-weighted mean of a
  // radiance that is linear in height keeps 2/3 of its slope.
  [[nodiscard]] static constexpr Vec3f dome_mean(float normal_height) noexcept {
    return dome(normal_height * (2.0f / 3.0f));
  }

  // Returns the mean cosine between a normal and the key light's disk, counting 0 below the horizon. Over the disk the
  // cosine is distributed like a semicircle, whose clamped mean has a closed form.
  [[nodiscard]] float key_cosine(Vec3f normal) const noexcept {
    const float cosine = dot(normal, key_direction);
    const float spread = kKeyRadius * std::sqrt(std::max(0.0f, 1.0f - cosine * cosine));
    if (cosine >= spread) return cosine;
    if (cosine <= -spread) return 0.0f;
    const float x = cosine / spread, rest = std::sqrt(1.0f - x * x);
    const float above =
        0.5f + std::numbers::inv_pi_v<float> * (x * rest + static_cast<float>(arc_sine(static_cast<double>(x))));
    return spread * (x * above + std::numbers::inv_pi_v<float> * (2.0f / 3.0f) * rest * rest * rest);
  }

  // Returns the background colour at a position in the frame, from the upper left (0, 0) to the lower right (1, 1).
  [[nodiscard]] static Vec3f backdrop(float x, float y) noexcept {
    const float dx = x - 0.5f, dy = y - 0.42f;
    const float fall = static_cast<float>(
        exponential(static_cast<double>(-2.2f * (dx * dx + dy * dy))));  // brighter behind the middle
    return Vec3f{0.42f, 0.43f, 0.445f} * (0.45f + 0.55f * fall);
  }
};

}  // namespace perfect_bvh
