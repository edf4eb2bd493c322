// A scene's lights with Blender's meaning: watts, distributed over the light's area.
// In: a light, a surface point and its normal, a random point on the light or a direction. Out: the direction to the
// light, the unoccluded light from there, and the probability density of that direction.
// Units: a point light of P watts shines with P / 4 pi into every direction. An area light of P watts has the radiance
// P / (pi area) on its one side. A sun's strength is the irradiance of a surface that faces it.
#pragma once

#include <cstdint>
#include <optional>

#include "math/vec3.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {

enum class LightKind : std::uint8_t { kPoint, kSun, kSpot, kRectangle, kEllipse };
inline constexpr int kLightKinds = 5;

struct Light {
  LightKind kind = LightKind::kPoint;
  bool casts_shadow = true;
  Vec3d position{0, 0, 0};
  Vec3f x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};  // unit axes; it shines along -z
  Vec3f power{0, 0, 0};                      // per channel; see above
  // Point and spot: the radius. Sun: the tangent of half its angle. Rectangle and ellipse: the two sides' lengths.
  float size_x = 0.0f, size_y = 0.0f;
  float cone_cosine = -1.0f;  // spot: of half its angle
  float cone_blend = 0.0f;    // spot: the share of the cone's width taken by its soft border
  float spread = 1.5707964f;  // rectangle and ellipse: lit angle from its axis, in radians; a quarter turn: all
};

struct LightRay {
  Vec3f direction{0, 0, 1};  // towards the light, unit length
  float length = 0.0f;       // to it; infinite for suns
  // Its irradiance over pi, times the surface's cosine: the light reflected by a white diffuse surface. Zero from
  // behind.
  Vec3f light{0, 0, 0};
  float density = 0.0f;  // of such directions, over solid angle; infinite for a light without size
};

// normal: zero for surfaces lit equally from all sides, without a cosine, such as strands.
[[nodiscard]] LightRay look_at_light(const Light& light, Vec3d point, Vec3f normal, Point2 random) noexcept;

// A light in a given direction.
struct LightMet {
  float length;    // to it; infinite for suns
  Vec3f radiance;  // radiance from the light
  float density;   // probability density of that direction in `look_at_light`
};
// For rays of mirroring surfaces: returns the light if `look_at_light` may choose the direction, which has unit length.
[[nodiscard]] std::optional<LightMet> meet_light(const Light& light, Vec3d point, Vec3f direction) noexcept;

// Estimates its `light`, to choose between lights; positive where light may arrive.
[[nodiscard]] float guess_light(const Light& light, Vec3d point, Vec3f normal) noexcept;

}  // namespace perfect_bvh
