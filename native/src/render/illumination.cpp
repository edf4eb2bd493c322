#include "render/illumination.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/directions.h"
#include "render/material.h"
#include "render/secondary_ray.h"
#include "render/studio.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kFewLights = 4;
constexpr int kPicks = 2;
// Rays end short of the light: what it hangs on should not put it out.
constexpr float kShort = 1.0f - 1e-5f;
constexpr int kMostLayers = 8;  // of transparent surfaces that a shadow ray passes
// Of the light from all around, what reaches the surface that a ray bounced off: nobody looks whether it is open.
constexpr float kOpenness = 0.3f;
// The same where it is seen in a mirror: what is below the horizon sends nothing, and little is more closed than that.
constexpr float kMirroredOpenness = 0.6f;
// Light that bounced once more than what it lights is seen by is no brighter than this: few paths carry it, and single
// bright ones would be specks. Cycles' "Clamp Indirect" has the same value.
constexpr float kMostBounced = 10.0f;
// Numbers of sampling dimensions, apart from the camera's and clay's.
constexpr std::uint32_t kSkyDimension = 8, kMirrorDimension = 9, kLightDimension = 16, kBounceDimension = 32;
constexpr std::uint32_t kGlowDimensions = 8;  // further on than those of the lights

Vec3f turned(Vec3f direction, float angle) noexcept {
  const float c = std::cos(angle), s = std::sin(angle);
  return {direction.x * c - direction.y * s, direction.x * s + direction.y * c, direction.z};
}

Vec3f at_most(Vec3f color, float most) noexcept {
  const float brightest = std::max({color.x, color.y, color.z});
  return brightest > most ? color * (most / brightest) : color;
}

bool is_black(Vec3f color) noexcept { return !(color.x > 0.0f || color.y > 0.0f || color.z > 0.0f); }

}  // namespace

Illumination::Illumination(const Snapshot& snapshot, const Appearance& appearance, std::uint32_t seed, int light_rays,
                           CancelToken& cancel)
    : snapshot_(snapshot),
      cancel_(cancel),
      appearance_(appearance),
      seed_(seed),
      light_rays_(light_rays),
      mean_surroundings_(find_mean_surroundings()),
      glow_(snapshot, appearance) {}

Vec3f Illumination::surroundings(Vec3f direction) const noexcept {
  if (!appearance_.world) return Studio::dome(direction.z);
  const World& world = *appearance_.world;
  if (world.image == kNoImage) return world.color;
  const Texture& image = appearance_.images[static_cast<std::size_t>(world.image)];
  return look_up_around(image, turned(direction, world.rotation)) * world.color;
}

Vec3f Illumination::find_mean_surroundings() const noexcept {
  constexpr std::uint32_t kDirections = 64;
  Vec3f sum{0, 0, 0};
  for (std::uint32_t i = 0; i < kDirections; ++i) {
    const Point2 random = sampling::scrambled_sobol(i, 0).to_unit();
    const float height = 2.0f * random.x - 1.0f, angle = 6.2831853f * random.y;
    const float radius = std::sqrt(std::max(0.0f, 1.0f - height * height));
    sum = sum + surroundings({radius * std::cos(angle), radius * std::sin(angle), height});
  }
  return sum * (1.0f / static_cast<float>(kDirections));
}

void Illumination::gather(Points at, std::uint32_t sample, Scratch& scratch) const {
  std::fill(at.light.begin(), at.light.end(), Vec3f{0, 0, 0});
  std::fill(at.shine.begin(), at.shine.end(), Vec3f{0, 0, 0});
  at.share = 1.0f / static_cast<float>(light_rays_);
  for (int i = 0; i < light_rays_; ++i) {
    const std::uint32_t index = sample * static_cast<std::uint32_t>(light_rays_) + static_cast<std::uint32_t>(i);
    add_lights(at, index, kLightDimension, scratch);
    add_surroundings(at, index, scratch);
    if (!at.glosses.empty()) add_mirrored(at, index, scratch);
  }
}

float Illumination::density_all_around(const SurfacePoint& point, Vec3f direction) noexcept {
  return std::max(dot(direction, point.light_normal), 0.0f) * std::numbers::inv_pi_v<float>;
}

void Illumination::add_lights(const Points& at, std::uint32_t index, std::uint32_t first_dimension,
                              Scratch& scratch) const {
  if (appearance_.lights.empty() && glow_.empty()) return;
  scratch.rays.clear(), scratch.targets.clear(), scratch.carried.clear(), scratch.shine.clear();
  if (appearance_.lights.size() <= kFewLights) {
    aim_at_each(at, index, first_dimension, scratch);
  } else {
    aim_at_some(at, index, first_dimension, scratch);
  }
  if (!glow_.empty()) aim_at_glow(at, index, first_dimension + kGlowDimensions, scratch);
  block(scratch);
  for (std::size_t i = 0; i < scratch.rays.size(); ++i) {
    Vec3f& light = at.light[scratch.targets[i]];
    light = light + scratch.carried[i] * scratch.passed[i];
    if (at.glosses.empty()) continue;
    Vec3f& shine = at.shine[scratch.targets[i]];
    shine = shine + scratch.shine[i] * scratch.passed[i];
  }
}

// Light by light, so that rays next to each other go the same way.
void Illumination::aim_at_each(const Points& at, std::uint32_t index, std::uint32_t first_dimension,
                               Scratch& scratch) const {
  for (std::uint32_t number = 0; number < appearance_.lights.size(); ++number) {
    const Dimension dimension(seed_, first_dimension + number);
    const FixedPoint2 shared = dimension.sample(index);
    for (std::uint32_t row = 0; row < at.points.size(); ++row) {
      const Point2 random = (shared ^ dimension.offset(at.places[row])).to_unit();
      aim(at, row, appearance_.lights[number], random, at.share, scratch);
    }
  }
}

void Illumination::aim_at_some(const Points& at, std::uint32_t index, std::uint32_t first_dimension,
                               Scratch& scratch) const {
  const std::vector<Light>& lights = appearance_.lights;
  scratch.guesses.resize(lights.size());
  const Dimension choice(seed_, first_dimension), first(seed_, first_dimension + 1), second(seed_, first_dimension + 2);
  for (std::uint32_t row = 0; row < at.points.size(); ++row) {
    const SurfacePoint& point = at.points[row];
    float sum = 0.0f;
    for (std::size_t i = 0; i < lights.size(); ++i) {
      sum += guess_light(lights[i], point.origin, point.light_normal);
      scratch.guesses[i] = sum;
    }
    if (!(sum > 0.0f) || !std::isfinite(sum)) continue;
    const Point2 chosen = (choice.sample(index) ^ choice.offset(at.places[row])).to_unit();
    for (int pick = 0; pick < kPicks; ++pick) {
      const float wanted = sum * (static_cast<float>(pick) + chosen.x) / static_cast<float>(kPicks);
      const auto found = std::upper_bound(scratch.guesses.begin(), scratch.guesses.end() - 1, wanted);
      const auto number = static_cast<std::size_t>(found - scratch.guesses.begin());
      const float guess = scratch.guesses[number] - (number > 0 ? scratch.guesses[number - 1] : 0.0f);
      if (!(guess > 0.0f)) continue;
      const Dimension& dimension = pick == 0 ? first : second;
      const Point2 random = (dimension.sample(index) ^ dimension.offset(at.places[row])).to_unit();
      aim(at, row, lights[number], random, at.share * sum / (guess * static_cast<float>(kPicks)), scratch);
    }
  }
}

void Illumination::aim(const Points& at, std::uint32_t row, const Light& light, Point2 random, float weight,
                       Scratch& scratch) const {
  const SurfacePoint& point = at.points[row];
  const LightRay to_light = look_at_light(light, point.origin, point.light_normal, random);
  const Vec3f carried = to_light.light * weight;
  if (is_black(carried)) return;
  const Gloss* const gloss = at.glosses.empty() ? nullptr : &at.glosses[row];
  Vec3f shine{0, 0, 0};
  if (gloss != nullptr && gloss->shines()) {
    shine = carried * highlight(*gloss, point.light_normal, to_light.direction);
  }
  if (!light.casts_shadow) {
    at.light[row] = at.light[row] + carried;
    if (gloss != nullptr) at.shine[row] = at.shine[row] + shine;
    return;
  }
  const Vec3f direction = above(point, to_light.direction);
  scratch.rays.push_back(ray_from(point, direction, to_light.length * kShort, appearance_.shadow_mask));
  scratch.targets.push_back(row);
  scratch.carried.push_back(carried), scratch.shine.push_back(shine);
}

// A ray that looks all around may meet the same place: by the balance heuristic (Veach and Guibas 1995) each way counts
// as much as it is likely to find it, so that neither is far off. See `look_along_rays`.
void Illumination::aim_at_glow(const Points& at, std::uint32_t index, std::uint32_t first_dimension,
                               Scratch& scratch) const {
  const Dimension choice(seed_, first_dimension), place(seed_, first_dimension + 1);
  for (std::uint32_t row = 0; row < at.points.size(); ++row) {
    const SurfacePoint& point = at.points[row];
    const Point2 pick = (choice.sample(index) ^ choice.offset(at.places[row])).to_unit();
    const GlowPoint glow = glow_.choose(pick.x, (place.sample(index) ^ place.offset(at.places[row])).to_unit());
    const Vec3f way = to_float(glow.position - point.origin);
    const float distance = length(way);
    if (!(distance > 0.0f) || !std::isfinite(distance)) continue;
    const Vec3f direction = way * (1.0f / distance);
    if (!point.lifted && !(dot(direction, point.geometric_normal) > 0.0f)) continue;
    const float around = density_all_around(point, direction);
    const float aimed = glow.density * distance * distance / std::abs(dot(direction, glow.normal));
    if (!(around > 0.0f) || !std::isfinite(aimed)) continue;
    const Vec3f carried = glow.radiance * (at.share * around / (aimed + around));
    const Gloss* const gloss = at.glosses.empty() ? nullptr : &at.glosses[row];
    Vec3f shine{0, 0, 0};
    if (gloss != nullptr && gloss->shines() && !gloss->mirrors()) {
      shine = carried * highlight(*gloss, point.light_normal, direction);
    }
    scratch.rays.push_back(ray_from(point, direction, distance * kShort, appearance_.shadow_mask));
    scratch.targets.push_back(row);
    scratch.carried.push_back(carried), scratch.shine.push_back(shine);
  }
}

void Illumination::block(Scratch& scratch) const {
  scratch.passed.assign(scratch.rays.size(), 1.0f);
  if (appearance_.any_transparent()) return block_partly(scratch);
  scratch.blocked.resize(scratch.rays.size());
  trace_occluded(snapshot_, cancel_, scratch.rays, scratch.blocked);
  for (std::size_t i = 0; i < scratch.rays.size(); ++i) {
    if (scratch.blocked[i] != 0) scratch.passed[i] = 0.0f;
  }
}

// Surface after surface takes its share, until nothing is left or nothing is in the way.
void Illumination::block_partly(Scratch& scratch) const {
  for (int layer = 0; layer < kMostLayers; ++layer) {
    scratch.hits.resize(scratch.rays.size());
    trace_closest(snapshot_, cancel_, scratch.rays, scratch.hits);
    bool goes_on = false;
    for (std::size_t i = 0; i < scratch.rays.size(); ++i) {
      const Hit& hit = scratch.hits[i];
      Ray& ray = scratch.rays[i];
      if (!hit.found()) {
        ray.t_min = 1.0f, ray.t_max = 0.0f;  // done: such a ray hits nothing
        continue;
      }
      const Instance& instance = snapshot_.instances[hit.instance_index];
      const std::int32_t material = appearance_.material_of(instance, hit.primitive_index);
      const bool is_last = layer + 1 == kMostLayers;
      const float passes = is_last ? 0.0f : material_at(appearance_, instance, hit, material).lets_light_through();
      scratch.passed[i] *= std::max(passes, 0.0f);
      ray.t_min = std::nextafter(hit.t, kInfiniteDistance);
      if (!(scratch.passed[i] > 0.0f)) ray.t_max = -1.0f;
      goes_on = true;
    }
    if (!goes_on) return;
  }
}

// Directions spread like the cosine, so that what comes from each counts the same.
void Illumination::add_surroundings(const Points& at, std::uint32_t index, Scratch& scratch) const {
  const Dimension dimension(seed_, kSkyDimension);
  const FixedPoint2 shared = dimension.sample(index);
  scratch.rays.clear(), scratch.densities.clear();
  for (std::size_t row = 0; row < at.points.size(); ++row) {
    const SurfacePoint& point = at.points[row];
    const Point2 random = (shared ^ dimension.offset(at.places[row])).to_unit();
    const Vec3f direction = above(point, cosine_direction(point.light_normal, random));
    scratch.rays.push_back(ray_from(point, direction, kInfiniteDistance, appearance_.diffuse_mask));
    scratch.densities.push_back(density_all_around(point, direction));
  }
  look_along_rays(at.places, index, kOpenness, scratch);
  for (std::size_t row = 0; row < at.points.size(); ++row) {
    at.light[row] = at.light[row] + scratch.arriving[row] * at.share;
  }
}

void Illumination::add_mirrored(const Points& at, std::uint32_t index, Scratch& scratch) const {
  const Dimension dimension(seed_, kMirrorDimension);
  const FixedPoint2 shared = dimension.sample(index);
  scratch.rays.clear(), scratch.mirrors.clear(), scratch.mirror_places.clear(), scratch.mirror_weights.clear();
  for (std::uint32_t row = 0; row < at.points.size(); ++row) {
    if (!at.glosses[row].mirrors()) continue;
    const SurfacePoint& point = at.points[row];
    const Point2 random = (shared ^ dimension.offset(at.places[row])).to_unit();
    const Mirrored way = mirrored(at.glosses[row], point.light_normal, random);
    if (is_black(way.weight)) continue;
    scratch.rays.push_back(ray_from(point, above(point, way.direction), kInfiniteDistance, appearance_.glossy_mask));
    scratch.mirrors.push_back(row), scratch.mirror_places.push_back(at.places[row]);
    scratch.mirror_weights.push_back(way.weight * at.share);
  }
  if (scratch.rays.empty()) return;
  scratch.densities.clear();
  look_along_rays(scratch.mirror_places, index, kMirroredOpenness, scratch);
  for (std::size_t i = 0; i < scratch.mirrors.size(); ++i) {
    Vec3f& shine = at.shine[scratch.mirrors[i]];
    shine = shine + scratch.arriving[i] * scratch.mirror_weights[i];
  }
}

void Illumination::look_along_rays(std::span<const std::uint32_t> places, std::uint32_t index, float openness,
                                   Scratch& scratch) const {
  scratch.hits.resize(scratch.rays.size());
  trace_closest(snapshot_, cancel_, scratch.rays, scratch.hits);
  scratch.bounce_points.clear(), scratch.bounce_places.clear();
  constexpr SurfaceNeeds kAll{.normals = true, .origins = true, .materials = true, .holdouts = true};
  find_surfaces(snapshot_, appearance_, kAll, scratch.rays, scratch.hits, scratch.bounce_points);
  AlignedVector<Vec3f>& arriving = scratch.arriving;
  arriving.assign(scratch.rays.size(), Vec3f{0, 0, 0});
  for (std::size_t i = 0; i < scratch.rays.size(); ++i) {
    if (!scratch.hits[i].found()) arriving[i] = surroundings(to_float(scratch.rays[i].direction));
  }
  scratch.bounce_materials.clear();
  for (const SurfacePoint& point : scratch.bounce_points) {
    const Hit& hit = scratch.hits[point.ray];
    const Instance& instance = snapshot_.instances[hit.instance_index];
    const Material material = material_at(appearance_, instance, hit, point.material);
    const Vec3f direction = to_float(scratch.rays[point.ray].direction);
    const float met = scratch.densities.empty() ? 1.0f : met_by_chance(point, direction, hit.t, scratch);
    arriving[point.ray] = surroundings(direction) * material.through() + material.emission * (material.alpha * met);
    scratch.bounce_materials.push_back(material);
    scratch.bounce_places.push_back(places[point.ray]);
  }
  light_bounces(index, openness, scratch);
}

// How much the glow of a surface counts that a ray met which looked all around.
float Illumination::met_by_chance(const SurfacePoint& point, Vec3f direction, float distance,
                                  const Scratch& scratch) const noexcept {
  const float chosen = glow_.density(point.material);
  if (!(chosen > 0.0f)) return 1.0f;
  const float around = scratch.densities[point.ray];
  const float aimed = chosen * distance * distance / std::abs(dot(direction, point.geometric_normal));
  return around > 0.0f ? around / (around + aimed) : 0.0f;
}

// Adds to what arrives along rays what the surfaces that they met give back of the light that they get themselves.
void Illumination::light_bounces(std::uint32_t index, float openness, Scratch& scratch) const {
  scratch.bounce_light.assign(scratch.bounce_points.size(), mean_surroundings_ * openness);
  add_lights({scratch.bounce_points, scratch.bounce_places, {}, scratch.bounce_light, {}}, index, kBounceDimension,
             scratch);
  for (std::size_t i = 0; i < scratch.bounce_points.size(); ++i) {
    const Material& material = scratch.bounce_materials[i];
    Vec3f& sum = scratch.arriving[scratch.bounce_points[i].ray];
    sum = sum + at_most(material.matt_color() * scratch.bounce_light[i] * material.alpha, kMostBounced);
  }
}

}  // namespace perfect_bvh
