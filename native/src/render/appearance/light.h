// A scene's lights, as Blender means them: watts, spread over what the light is.
// In: a light, a surface point and its normal, a random place on the light or a direction. Out: where to look for it,
// what comes from there if nothing stands between, and how likely that direction is chosen.
// Units: a point light of P watts shines with P / 4 pi into every direction; an area light of P watts has the radiance
// P / (pi area) on its one side; a sun's strength is what falls on a surface that faces it.
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
  Vec3f power{0, 0, 0};                      // of each channel; see above
  // Point and spot: the radius. Sun: the tangent of half its angle. Rectangle and ellipse: the two sides' lengths.
  float size_x = 0.0f, size_y = 0.0f;
  float cone_cosine = -1.0f;  // spot: of half its angle
  float cone_blend = 0.0f;    // spot: how much of the cone's width its soft border takes
  float spread = 1.5707964f;  // rectangle and ellipse: how far from its axis it shines, in radians; a quarter turn: all
};

struct LightRay {
  Vec3f direction{0, 0, 1};  // towards the light, unit length
  float length = 0.0f;       // to it; infinite for suns
  // Its irradiance over pi, times the surface's cosine: what a white diffuse surface gives back. Zero from behind.
  Vec3f light{0, 0, 0};
  float density = 0.0f;  // of such directions, over solid angle; infinite for a light without size
};

// normal: zero for what is lit alike from all sides, without a cosine: strands.
[[nodiscard]] LightRay look_at_light(const Light& light, Vec3d point, Vec3f normal, Point2 random) noexcept;

// A light that a direction leads to.
struct LightMet {
  float length;    // to it; infinite for suns
  Vec3f radiance;  // that comes from it
  float density;   // with which `look_at_light` chooses the direction
};
// For rays that look where a surface mirrors: the light where `look_at_light` may choose the direction, of unit length.
[[nodiscard]] std::optional<LightMet> meet_light(const Light& light, Vec3d point, Vec3f direction) noexcept;

// How bright its `light` may be, for choosing between lights: positive wherever that can be.
[[nodiscard]] float guess_light(const Light& light, Vec3d point, Vec3f normal) noexcept;

}  // namespace perfect_bvh
