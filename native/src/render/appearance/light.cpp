#include "render/appearance/light.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "math/elementary.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

float brightness(Vec3f color) noexcept { return std::max({color.x, color.y, color.z}); }

// Returns the share of its light that a spot sends along a direction with this cosine to its axis.
float cone_share(const Light& light, float cosine) noexcept {
  if (light.kind != LightKind::kSpot) return 1.0f;
  if (cosine <= light.cone_cosine) return 0.0f;
  const float border = (1.0f - light.cone_cosine) * light.cone_blend;
  const float part = border > 0.0f ? std::min((cosine - light.cone_cosine) / border, 1.0f) : 1.0f;
  return part * part * (3.0f - 2.0f * part);
}

// Returns how much brighter an area light is, along a direction with this cosine to its axis, than one without spread.
// It acts like a grid in front of the light: less is visible between the slats at larger angles, up to the spread. The
// watts stay the same: the integral of this over the cosine is the same as without a grid.
float grid_share(const Light& light, float cosine) noexcept {
  if (!(light.spread < 0.5f * kPi - 1e-4f)) return 1.0f;
  const auto [sine, cosine_of_spread] = sine_cosine(light.spread);
  const float farthest = sine / cosine_of_spread;
  const float aslant = std::sqrt(std::max(1.0f - cosine * cosine, 0.0f)) / std::max(cosine, 1e-6f);
  // tan x - x loses its digits for small x.
  const float rest = light.spread < 0.05f ? farthest * farthest * farthest / 3.0f : farthest - light.spread;
  return std::max(farthest - aslant, 0.0f) / std::max(rest, 1e-12f);
}

// Returns the cosine by which light from a direction is spread over a surface, zero from behind. A surface without a
// normal is lit equally from all sides.
float cosine_on(Vec3f normal, Vec3f direction) noexcept {
  return normal == Vec3f{0, 0, 0} ? 1.0f : std::max(dot(direction, normal), 0.0f);
}

bool is_area(const Light& light) noexcept {
  return light.kind == LightKind::kRectangle || light.kind == LightKind::kEllipse;
}

float square(float value) noexcept { return value * value; }

// A sun is a cone of directions, all equally bright. Its depth is one minus the cosine of half its angle, without
// cancellation; the density of directions in it is 1 / (2 pi depth).
float sun_depth(const Light& light) noexcept {
  const float squared = 1.0f + square(light.size_x);
  return square(light.size_x) / (squared + std::sqrt(squared));
}

// Returns the mean, over its directions, of what faces its middle: more than `power`, because it sees some at a slant.
Vec3f sun_power(const Light& light) noexcept { return light.power * (2.0f / (2.0f - sun_depth(light))); }

LightRay look_at_sun(const Light& light, Vec3f normal, Point2 random) noexcept {
  const Point2 flat = uniform_disk(random);
  const float depth = sun_depth(light), here = depth * (square(flat.x) + square(flat.y));
  const Vec3f aside = (light.x * flat.x + light.y * flat.y) * std::sqrt(depth * (2.0f - here));
  const Vec3f direction = normalized(light.z * (1.0f - here) + aside);
  return {direction, std::numeric_limits<float>::infinity(), sun_power(light) * (cosine_on(normal, direction) / kPi),
          1.0f / (2.0f * kPi * depth)};
}

std::optional<LightMet> meet_sun(const Light& light, Vec3f direction) noexcept {
  const float cosine = dot(direction, light.z);
  const bool inside = 1.0f - square(cosine) <= square(light.size_x * cosine);
  if (!(cosine > 0.0f) || !(light.size_x > 0.0f) || !inside) return std::nullopt;
  const float density = 1.0f / (2.0f * kPi * sun_depth(light));
  return LightMet{std::numeric_limits<float>::infinity(), sun_power(light) * density, density};
}

float area_of(const Light& light) noexcept {
  return (light.kind == LightKind::kEllipse ? 0.25f * kPi : 1.0f) * light.size_x * light.size_y;
}

LightRay look_at_area(const Light& light, Vec3d point, Vec3f normal, Point2 random) noexcept {
  Point2 flat{random.x - 0.5f, random.y - 0.5f};
  if (light.kind == LightKind::kEllipse) {
    flat = uniform_disk(random);
    flat = {flat.x * 0.5f, flat.y * 0.5f};
  }
  const Vec3f offset = light.x * (flat.x * light.size_x) + light.y * (flat.y * light.size_y);
  const Vec3f way = to_float(light.position - point) + offset;
  const float distance = length(way);
  if (!(distance > 0.0f)) return {};
  const Vec3f direction = way * (1.0f / distance);
  const float cosine = cosine_on(normal, direction), light_cosine = std::max(dot(direction, light.z), 0.0f);
  // Radiance P / (pi A), seen from an area A: A cancels.
  const float share = cosine * light_cosine * grid_share(light, light_cosine) / (kPi * kPi * distance * distance);
  return {direction, distance, light.power * share, square(distance) / (light_cosine * area_of(light))};
}

std::optional<LightMet> meet_area(const Light& light, Vec3d point, Vec3f direction) noexcept {
  const float cosine = dot(direction, light.z), area = area_of(light);
  if (!(cosine > 0.0f) || !(area > 0.0f)) return std::nullopt;
  const Vec3f to_centre = to_float(light.position - point);
  const float distance = dot(to_centre, light.z) / cosine;
  if (!(distance > 0.0f) || !std::isfinite(distance)) return std::nullopt;
  const Vec3f offset = direction * distance - to_centre;
  const float x = 2.0f * dot(offset, light.x) / light.size_x, y = 2.0f * dot(offset, light.y) / light.size_y;
  const bool inside =
      light.kind == LightKind::kEllipse ? x * x + y * y <= 1.0f : std::abs(x) <= 1.0f && std::abs(y) <= 1.0f;
  if (!inside) return std::nullopt;
  const float radiance = grid_share(light, cosine) / (kPi * area);
  return LightMet{distance, light.power * radiance, square(distance) / (cosine * area)};
}

// A sphere is a disk through its centre that faces the point ("Soft Falloff"), so that light on surfaces that touch it
// stays finite.
LightRay look_at_ball(const Light& light, Vec3d point, Vec3f normal, Point2 random) noexcept {
  const Vec3f to_centre = to_float(light.position - point);
  const float distance = length(to_centre);
  if (!(distance > 0.0f)) return {};
  const Frame frame(to_centre * (1.0f / distance));
  const Point2 flat = uniform_disk(random);
  const Vec3f way = to_centre + (frame.x * flat.x + frame.y * flat.y) * light.size_x;
  const float way_length = length(way);
  const Vec3f direction = way * (1.0f / way_length);
  const float cosine = cosine_on(normal, direction), light_cosine = dot(direction, frame.z);
  const float share = cone_share(light, dot(frame.z, light.z)) * cosine * light_cosine;
  const float density = square(way_length) / (kPi * square(light.size_x) * light_cosine);
  return {direction, way_length, light.power * (share / (4.0f * kPi * kPi * square(way_length))), density};
}

std::optional<LightMet> meet_ball(const Light& light, Vec3d point, Vec3f direction) noexcept {
  const Vec3f to_centre = to_float(light.position - point);
  const float distance = length(to_centre);
  if (!(distance > 0.0f) || !(light.size_x > 0.0f)) return std::nullopt;
  const Vec3f axis = to_centre * (1.0f / distance);
  const float cosine = dot(direction, axis);
  if (!(cosine > 0.0f)) return std::nullopt;
  const float way_length = distance / cosine;
  if (!(length(direction * way_length - to_centre) <= light.size_x)) return std::nullopt;
  const float density = square(way_length) / (kPi * square(light.size_x) * cosine);
  const float share = cone_share(light, dot(axis, light.z)) / (4.0f * kPi * kPi * square(light.size_x));
  return LightMet{way_length, light.power * share, density};
}

}  // namespace

LightRay look_at_light(const Light& light, Vec3d point, Vec3f normal, Point2 random) noexcept {
  if (light.kind == LightKind::kSun) return look_at_sun(light, normal, random);
  return is_area(light) ? look_at_area(light, point, normal, random) : look_at_ball(light, point, normal, random);
}

std::optional<LightMet> meet_light(const Light& light, Vec3d point, Vec3f direction) noexcept {
  if (light.kind == LightKind::kSun) return meet_sun(light, direction);
  return is_area(light) ? meet_area(light, point, direction) : meet_ball(light, point, direction);
}

float guess_light(const Light& light, Vec3d point, Vec3f normal) noexcept {
  const float power = brightness(light.power);
  const bool all_sides = normal == Vec3f{0, 0, 0};
  if (light.kind == LightKind::kSun) {
    return power * (all_sides ? 1.0f : std::clamp(dot(light.z, normal) + light.size_x, 0.0f, 1.0f)) / kPi;
  }
  const Vec3f way = to_float(light.position - point);
  const float reach =
      is_area(light) ? 0.5f * std::sqrt(light.size_x * light.size_x + light.size_y * light.size_y) : light.size_x;
  const float distance = std::max(length(way), 1e-20f);
  const float spread = reach / distance;  // upper bound of the border's distance from the centre's direction
  const float cosine = all_sides ? 1.0f : std::clamp(dot(way, normal) / distance + spread, 0.0f, 1.0f);
  const float nearest = std::max(distance - reach, 0.5f * std::max(distance, reach));
  float share = 1.0f / (4.0f * kPi * kPi * nearest * nearest);
  if (is_area(light)) {
    const float light_cosine = std::clamp(dot(way, light.z) / distance + spread, 0.0f, 1.0f);
    share *= 4.0f * light_cosine * grid_share(light, std::min(light_cosine + spread, 1.0f));
  }
  return power * cosine * share * cone_share(light, dot(way, light.z) / distance);
}

}  // namespace perfect_bvh
