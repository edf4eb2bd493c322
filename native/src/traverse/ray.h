// Rays and hits as every kernel and every caller of a kernel knows them.
#pragma once

#include <cstdint>
#include <limits>

#include "math/vec3.h"

namespace perfect_bvh {

inline constexpr float kInfiniteDistance = std::numeric_limits<float>::infinity();
inline constexpr std::uint32_t kNoHit = 0xFFFFFFFFu;

// Which side of a triangle is passed through. Front: counter-clockwise in world space, as seen from the ray's origin.
enum class Cull : std::uint8_t { kNone, kBack, kFront };

// World space. t is in multiples of the direction's length; a hit counts if t_min <= t <= t_max.
struct alignas(64) Ray {
  Vec3d origin{0, 0, 0};
  Vec3d direction{0, 0, 0};
  float t_min = 0.0f;
  float t_max = kInfiniteDistance;
  std::uint32_t mask = 0xFFFFFFFFu;  // an instance is seen if it shares a bit
  float time = 0.0f;                 // within the shutter: from 0, its opening, to 1
};
static_assert(sizeof(Ray) == 64);

// t is infinite on a miss, and the indices kNoHit. instance_index is the row in Snapshot::instances;
// the hit point is (1-u-v) v0 + u v1 + v v2 of the triangle.
struct Hit {
  float t = kInfiniteDistance;
  float u = 0.0f;
  float v = 0.0f;
  std::uint32_t instance_index = kNoHit;
  std::uint32_t primitive_index = kNoHit;

  [[nodiscard]] bool found() const noexcept { return instance_index != kNoHit; }
};

// The time of rays that have none of their own.
inline constexpr float kShutterOpens = 0.0f;
// Another one than 0 to 1, NaN included, is no time.
[[nodiscard]] static inline bool is_in_shutter(float time) noexcept { return time >= 0.0f && time <= 1.0f; }

// False for rays that can hit nothing: a non-finite or zero direction, a non-finite origin, NaN or crossed t range, no
// time.
[[nodiscard]] inline bool is_valid(const Ray& ray) noexcept {
  return is_finite(ray.origin) && is_finite(ray.direction) && !(ray.direction == Vec3d{0, 0, 0}) &&
         ray.t_min <= ray.t_max && is_in_shutter(ray.time);
}

}  // namespace perfect_bvh
