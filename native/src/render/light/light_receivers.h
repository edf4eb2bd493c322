// Points at which light is gathered, and what was found there.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numbers>
#include <span>

#include "render/surface/specular.h"
#include "render/surface/surface.h"

namespace perfect_bvh {

// A row a point. places: a number by which its samples differ from its neighbours' (sampling::z_order). speculars,
// shine: empty where nothing is glossy. light: irradiance over pi: what a white diffuse surface gives back. shine: what
// a glossy one adds to that.
struct PointsToLight {
  std::span<const SurfacePoint> points;
  std::span<const std::uint32_t> places;
  std::span<const Specular> speculars;
  std::span<Vec3f> light, shine;
  float share = 1.0f;     // of a single ray
  bool by_chance = true;  // whether cosine-distributed rays are cast, too

  // Whether it adds what it mirrors by rays that look where it mirrors.
  [[nodiscard]] bool mirrors(std::size_t row) const noexcept { return !speculars.empty() && speculars[row].mirrors(); }
  // Whether it has highlights, but mirrors nothing else that is worth a ray.
  [[nodiscard]] bool only_shines(std::size_t row) const noexcept {
    return !speculars.empty() && speculars[row].shines() && !speculars[row].mirrors();
  }
  [[nodiscard]] bool is_diffuse(std::size_t row) const noexcept {
    return speculars.empty() || speculars[row].over_diffuse;
  }
};

// The density over solid angle of cosine-distributed rays.
[[nodiscard]] inline float density_all_around(const SurfacePoint& point, Vec3f direction) noexcept {
  return std::max(dot(direction, point.light_normal), 0.0f) * std::numbers::inv_pi_v<float>;
}

[[nodiscard]] inline bool is_black(Vec3f color) noexcept {
  return !(color.x > 0.0f || color.y > 0.0f || color.z > 0.0f);
}

}  // namespace perfect_bvh
