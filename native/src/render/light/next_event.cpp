#include "render/light/next_event.h"

#include <algorithm>
#include <cmath>

#include "render/light/multiple_importance.h"
#include "render/light/secondary_ray.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kFewLights = 4;
constexpr int kPicks = 2;
// Rays end short of the light: what it hangs on should not put it out.
constexpr float kShort = 1.0f - 1e-5f;
// Further on than those of the lights.
constexpr std::uint32_t kGlowDimensions = 8, kSkyDimensions = 10;

}  // namespace

NextEvent::NextEvent(const Snapshot& snapshot, const Appearance& appearance, const Environment& environment,
                     std::uint32_t seed)
    : appearance_(appearance),
      environment_(environment),
      seed_(seed),
      emissive_(snapshot, appearance),
      any_large_(std::any_of(appearance.lights.begin(), appearance.lights.end(),
                             [](const Light& light) { return light.size_x > 0.0f; })) {}

bool NextEvent::asks_each() const noexcept { return appearance_.lights.size() <= kFewLights; }

void NextEvent::aim(const PointsToLight& at, std::span<const Mirrored> lobes, std::uint32_t index,
                    std::uint32_t first_dimension, Scratch& scratch, ShadowRays& shadows) const {
  if (asks_each()) {
    aim_at_each(at, index, first_dimension, shadows);
  } else {
    aim_at_some(at, index, first_dimension, scratch, shadows);
  }
  if (any_large_ && !lobes.empty()) meet_lights(at, lobes, scratch, shadows);
  if (!emissive_.empty()) aim_at_emissive(at, index, first_dimension + kGlowDimensions, shadows);
  if (environment_.can_be_aimed_at()) aim_at_sky(at, index, first_dimension + kSkyDimensions, shadows);
}

// Light by light, so that rays next to each other go the same way.
void NextEvent::aim_at_each(const PointsToLight& at, std::uint32_t index, std::uint32_t first_dimension,
                            ShadowRays& shadows) const {
  for (std::uint32_t number = 0; number < appearance_.lights.size(); ++number) {
    const Dimension dimension(seed_, first_dimension + number);
    const FixedPoint2 shared = dimension.sample(index);
    for (std::uint32_t row = 0; row < at.points.size(); ++row) {
      const Point2 random = (shared ^ dimension.offset(at.places[row])).to_unit();
      aim_at(at, row, appearance_.lights[number], random, 1.0f, shadows);
    }
  }
}

void NextEvent::aim_at_some(const PointsToLight& at, std::uint32_t index, std::uint32_t first_dimension,
                            Scratch& scratch, ShadowRays& shadows) const {
  const std::vector<Light>& lights = appearance_.lights;
  scratch.guesses.resize(lights.size()), scratch.sums.assign(at.points.size(), 0.0f);
  const Dimension choice(seed_, first_dimension), first(seed_, first_dimension + 1), second(seed_, first_dimension + 2);
  for (std::uint32_t row = 0; row < at.points.size(); ++row) {
    const SurfacePoint& point = at.points[row];
    float sum = 0.0f;
    for (std::size_t i = 0; i < lights.size(); ++i) {
      sum += guess_light(lights[i], point.origin, point.light_normal);
      scratch.guesses[i] = sum;
    }
    if (!(sum > 0.0f) || !std::isfinite(sum)) continue;
    scratch.sums[row] = sum;
    const Point2 chosen = (choice.sample(index) ^ choice.offset(at.places[row])).to_unit();
    for (int pick = 0; pick < kPicks; ++pick) {
      const float wanted = sum * (static_cast<float>(pick) + chosen.x) / static_cast<float>(kPicks);
      const auto found = std::upper_bound(scratch.guesses.begin(), scratch.guesses.end() - 1, wanted);
      const auto number = static_cast<std::size_t>(found - scratch.guesses.begin());
      const float guess = scratch.guesses[number] - (number > 0 ? scratch.guesses[number - 1] : 0.0f);
      if (!(guess > 0.0f)) continue;
      const Dimension& dimension = pick == 0 ? first : second;
      const Point2 random = (dimension.sample(index) ^ dimension.offset(at.places[row])).to_unit();
      aim_at(at, row, lights[number], random, static_cast<float>(kPicks) * guess / sum, shadows);
    }
  }
}

void NextEvent::aim_at(const PointsToLight& at, std::uint32_t row, const Light& light, Point2 random, float tries,
                       ShadowRays& shadows) const {
  const SurfacePoint& point = at.points[row];
  const LightRay to_light = look_at_light(light, point.origin, point.light_normal, random);
  const Vec3f carried = to_light.light * (at.share / tries);
  if (is_black(carried)) return;
  Vec3f shine{0, 0, 0};
  if (!at.speculars.empty() && at.speculars[row].shines()) {
    const Highlight seen = highlight(at.speculars[row], point.light_normal, to_light.direction);
    const float counts = at.mirrors(row) ? balance(to_light.density * tries, seen.density) : 1.0f;
    shine = carried * seen.share * counts;
  }
  if (!at.is_diffuse(row) && is_black(shine)) return;
  if (!light.casts_shadow) {
    at.light[row] = at.light[row] + carried;
    if (!at.shine.empty()) at.shine[row] = at.shine[row] + shine;
    return;
  }
  const Vec3f direction = above(point, to_light.direction);
  shadows.add(ray_from(point, direction, to_light.length * kShort, appearance_.shadow_mask), row, carried, shine);
}

// Lights are no surfaces: the rays that look where a surface mirrors would pass them by.
void NextEvent::meet_lights(const PointsToLight& at, std::span<const Mirrored> lobes, const Scratch& scratch,
                            ShadowRays& shadows) const {
  for (std::uint32_t row = 0; row < at.points.size(); ++row) {
    const Mirrored& lobe = lobes[row];
    if (is_black(lobe.weight)) continue;
    const SurfacePoint& point = at.points[row];
    for (const Light& light : appearance_.lights) {
      const std::optional<LightMet> met = meet_light(light, point.origin, lobe.direction);
      if (!met) continue;
      float tries = 1.0f;
      if (!asks_each()) {
        const float sum = scratch.sums[row], guess = guess_light(light, point.origin, point.light_normal);
        tries = sum > 0.0f ? static_cast<float>(kPicks) * guess / sum : 0.0f;
      }
      const float counts = balance(lobe.density, met->density * tries);
      const Vec3f shine = lobe.weight * met->radiance * (at.share * counts);
      if (is_black(shine)) continue;
      if (light.casts_shadow) {
        const Ray ray = ray_from(point, above(point, lobe.direction), met->length * kShort, appearance_.shadow_mask);
        shadows.add(ray, row, {0, 0, 0}, shine);
      } else {
        at.shine[row] = at.shine[row] + shine;
      }
    }
  }
}

void NextEvent::aim_at_emissive(const PointsToLight& at, std::uint32_t index, std::uint32_t first_dimension,
                                ShadowRays& shadows) const {
  const Dimension choice(seed_, first_dimension), place(seed_, first_dimension + 1);
  for (std::uint32_t row = 0; row < at.points.size(); ++row) {
    const SurfacePoint& point = at.points[row];
    const Point2 pick = (choice.sample(index) ^ choice.offset(at.places[row])).to_unit();
    const EmissivePoint glow = emissive_.choose(pick.x, (place.sample(index) ^ place.offset(at.places[row])).to_unit());
    const Vec3f way = to_float(glow.position - point.origin);
    const float distance = length(way);
    if (!(distance > 0.0f) || !std::isfinite(distance)) continue;
    const Vec3f direction = way * (1.0f / distance);
    if (!point.lifted && !(dot(direction, point.geometric_normal) > 0.0f)) continue;
    const float around = density_all_around(point, direction);
    const float aimed = glow.density * distance * distance / std::abs(dot(direction, glow.normal));
    if (!(around > 0.0f) || !std::isfinite(aimed)) continue;
    const Vec3f radiance = glow.radiance * at.share;
    Vec3f shine{0, 0, 0};
    if (!at.speculars.empty() && at.speculars[row].shines() && (glow.mask & appearance_.glossy_mask) != 0) {
      const Highlight seen = highlight(at.speculars[row], point.light_normal, direction);
      shine = radiance * seen.share * (around / (aimed + (at.mirrors(row) ? seen.density : around)));
    }
    const Vec3f light = radiance * (around / (aimed + around));
    shadows.add(ray_from(point, direction, distance * kShort, appearance_.shadow_mask), row, light, shine);
  }
}

void NextEvent::aim_at_sky(const PointsToLight& at, std::uint32_t index, std::uint32_t dimension,
                           ShadowRays& shadows) const {
  const Dimension place(seed_, dimension);
  const FixedPoint2 shared = place.sample(index);
  for (std::uint32_t row = 0; row < at.points.size(); ++row) {
    const SurfacePoint& point = at.points[row];
    const BrightSky::Choice sky = environment_.aim((shared ^ place.offset(at.places[row])).to_unit());
    const float around = density_all_around(point, sky.direction);
    if (!(around > 0.0f)) continue;
    const Vec3f radiance = environment_.parts(sky.direction).bright * at.share;
    Vec3f shine{0, 0, 0};
    if (!at.speculars.empty() && at.speculars[row].shines()) {
      const Highlight seen = highlight(at.speculars[row], point.light_normal, sky.direction);
      shine = radiance * seen.share * (around / (sky.density + (at.mirrors(row) ? seen.density : around)));
    }
    const Vec3f light = radiance * (around / (sky.density + (at.by_chance ? around : 0.0f)));
    if (is_black(shine) && (!at.is_diffuse(row) || is_black(light))) continue;
    const Ray ray = ray_from(point, above(point, sky.direction), kInfiniteDistance, appearance_.shadow_mask);
    shadows.add(ray, row, light, shine);
  }
}

}  // namespace perfect_bvh
