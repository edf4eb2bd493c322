#include "render/light/illumination.h"

#include <algorithm>
#include <cmath>

#include "render/light/multiple_importance.h"
#include "render/light/secondary_ray.h"
#include "render/sampling/directions.h"

namespace perfect_bvh {
namespace {

// The share of the environment that is taken to reach a surface after a bounce: no ray is cast to find out.
constexpr float kOpenness = 0.3f;
// The same where it is seen in a mirror: what is below the horizon sends nothing, and little is more closed than that.
constexpr float kMirroredOpenness = 0.6f;
// Light that bounced once more than what it lights is seen by is no brighter than this: few paths carry it, and single
// bright ones would be specks. Cycles' "Clamp Indirect" has the same value.
constexpr float kMostBounced = 10.0f;
// Numbers of sampling dimensions, apart from the camera's and clay's.
constexpr std::uint32_t kSkyDimension = 8, kMirrorDimension = 9, kLightDimension = 16, kBounceDimension = 32;

Vec3f at_most(Vec3f color, float most) noexcept {
  const float brightest = std::max({color.x, color.y, color.z});
  return brightest > most ? color * (most / brightest) : color;
}

}  // namespace

Illumination::Illumination(const Snapshot& snapshot, const Appearance& appearance, std::uint32_t seed, int light_rays,
                           int threads, CancelToken& cancel)
    : snapshot_(snapshot),
      cancel_(cancel),
      appearance_(appearance),
      seed_(seed),
      light_rays_(light_rays),
      environment_(appearance, threads),
      next_event_(snapshot, appearance, environment_, seed) {}

void Illumination::gather(PointsToLight at, std::uint32_t sample, Scratch& scratch) const {
  std::fill(at.light.begin(), at.light.end(), Vec3f{0, 0, 0});
  std::fill(at.shine.begin(), at.shine.end(), Vec3f{0, 0, 0});
  at.share = 1.0f / static_cast<float>(light_rays_);
  for (int i = 0; i < light_rays_; ++i) {
    const std::uint32_t index = sample * static_cast<std::uint32_t>(light_rays_) + static_cast<std::uint32_t>(i);
    choose_lobes(at, index, scratch);
    add_aimed(at, scratch.lobes, index, kLightDimension, scratch);
    add_environment(at, index, scratch);
    add_mirrored(at, index, scratch);
  }
}

void Illumination::choose_lobes(const PointsToLight& at, std::uint32_t index, Scratch& scratch) const {
  const Dimension dimension(seed_, kMirrorDimension);
  const FixedPoint2 shared = dimension.sample(index);
  scratch.lobes.assign(at.speculars.size(), Mirrored{});
  for (std::size_t row = 0; row < at.speculars.size(); ++row) {
    if (!at.mirrors(row)) continue;
    const Point2 random = (shared ^ dimension.offset(at.places[row])).to_unit();
    scratch.lobes[row] = mirrored(at.speculars[row], at.points[row].light_normal, random);
  }
}

void Illumination::add_aimed(const PointsToLight& at, std::span<const Mirrored> lobes, std::uint32_t index,
                             std::uint32_t first_dimension, Scratch& scratch) const {
  if (next_event_.empty()) return;
  ShadowRays& shadows = scratch.shadows;
  shadows.clear();
  next_event_.aim(at, lobes, index, first_dimension, scratch.choices, shadows);
  find_what_passes(snapshot_, appearance_, cancel_, shadows);
  for (std::size_t i = 0; i < shadows.rays.size(); ++i) {
    Vec3f& light = at.light[shadows.targets[i]];
    light = light + shadows.carried[i] * shadows.passed[i];
    if (at.speculars.empty()) continue;
    Vec3f& shine = at.shine[shadows.targets[i]];
    shine = shine + shadows.shine[i] * shadows.passed[i];
  }
}

// Directions spread like the cosine, so that what comes from each counts the same.
void Illumination::add_environment(const PointsToLight& at, std::uint32_t index, Scratch& scratch) const {
  const Dimension dimension(seed_, kSkyDimension);
  const FixedPoint2 shared = dimension.sample(index);
  scratch.rays.clear(), scratch.rows.clear(), scratch.places.clear(), scratch.densities.clear();
  for (std::uint32_t row = 0; row < at.points.size(); ++row) {
    if (!at.is_diffuse(row)) continue;
    const SurfacePoint& point = at.points[row];
    const Point2 random = (shared ^ dimension.offset(at.places[row])).to_unit();
    const Vec3f direction = above(point, cosine_direction(point.light_normal, random));
    scratch.rays.push_back(ray_from(point, direction, kInfiniteDistance, appearance_.diffuse_mask));
    scratch.rows.push_back(row), scratch.places.push_back(at.places[row]);
    scratch.densities.push_back(density_all_around(point, direction));
  }
  if (scratch.rays.empty()) return;
  look_along_rays(index, kOpenness, scratch);
  for (std::size_t i = 0; i < scratch.rays.size(); ++i) {
    const std::uint32_t row = scratch.rows[i];
    at.light[row] = at.light[row] + scratch.arriving[i] * at.share;
    if (!at.only_shines(row) || is_black(scratch.aimed_at[i])) continue;
    const Vec3f direction = to_float(scratch.rays[i].direction);
    const Highlight seen = highlight(at.speculars[row], at.points[row].light_normal, direction);
    at.shine[row] = at.shine[row] + scratch.aimed_at[i] * seen.share * at.share;
  }
}

void Illumination::add_mirrored(const PointsToLight& at, std::uint32_t index, Scratch& scratch) const {
  scratch.rays.clear(), scratch.rows.clear(), scratch.places.clear(), scratch.densities.clear();
  for (std::uint32_t row = 0; row < scratch.lobes.size(); ++row) {
    const Mirrored& lobe = scratch.lobes[row];
    if (is_black(lobe.weight)) continue;
    const SurfacePoint& point = at.points[row];
    scratch.rays.push_back(ray_from(point, above(point, lobe.direction), kInfiniteDistance, appearance_.glossy_mask));
    scratch.rows.push_back(row), scratch.places.push_back(at.places[row]);
    scratch.densities.push_back(lobe.density);
  }
  if (scratch.rays.empty()) return;
  look_along_rays(index, kMirroredOpenness, scratch);
  for (std::size_t i = 0; i < scratch.rays.size(); ++i) {
    const std::uint32_t row = scratch.rows[i];
    at.shine[row] = at.shine[row] + scratch.arriving[i] * scratch.lobes[row].weight * at.share;
  }
}

void Illumination::look_along_rays(std::uint32_t index, float openness, Scratch& scratch) const {
  scratch.hits.resize(scratch.rays.size());
  trace_closest(snapshot_, cancel_, scratch.rays, scratch.hits);
  scratch.bounce_points.clear(), scratch.bounce_places.clear(), scratch.bounce_materials.clear();
  constexpr SurfaceNeeds kAll{.normals = true, .origins = true, .materials = true, .holdouts = true};
  find_surfaces(snapshot_, appearance_, kAll, scratch.rays, scratch.hits, scratch.bounce_points);
  scratch.arriving.assign(scratch.rays.size(), Vec3f{0, 0, 0});
  scratch.aimed_at.assign(scratch.rays.size(), Vec3f{0, 0, 0});
  for (std::size_t i = 0; i < scratch.rays.size(); ++i) {
    if (!scratch.hits[i].found()) see_environment(i, 1.0f, scratch);
  }
  for (const SurfacePoint& point : scratch.bounce_points) see_surface(point, scratch);
  light_bounces(index, openness, scratch);
}

void Illumination::see_environment(std::size_t ray, float passing, Scratch& scratch) const {
  const Vec3f direction = to_float(scratch.rays[ray].direction);
  auto [plain, bright] = environment_.parts(direction);
  if (!is_black(bright)) {
    bright = bright * (passing * balance(scratch.densities[ray], environment_.density(direction)));
    scratch.aimed_at[ray] = scratch.aimed_at[ray] + bright;
  }
  scratch.arriving[ray] = scratch.arriving[ray] + plain * passing + bright;
}

// What a surface that a ray met sends along it of its own, and what passes it.
void Illumination::see_surface(const SurfacePoint& point, Scratch& scratch) const {
  const Hit& hit = scratch.hits[point.ray];
  const Instance& instance = snapshot_.instances[hit.instance_index];
  const Material material = material_at(appearance_, instance, hit, point.material);
  Vec3f glow = material.emission * material.alpha;
  if (const float chosen = next_event_.glow().density(instance, point.material); chosen > 0.0f) {
    const float slant = std::abs(dot(to_float(scratch.rays[point.ray].direction), point.geometric_normal));
    glow = glow * balance(scratch.densities[point.ray], chosen * hit.t * hit.t / slant);
    if ((instance.mask & appearance_.glossy_mask) != 0) scratch.aimed_at[point.ray] = glow;
  }
  scratch.arriving[point.ray] = glow;
  if (material.through() > 0.0f) see_environment(point.ray, material.through(), scratch);
  scratch.bounce_materials.push_back(material);
  scratch.bounce_places.push_back(scratch.places[point.ray]);
}

// Adds to what arrives along rays what the surfaces that they met give back of the light that they get themselves.
void Illumination::light_bounces(std::uint32_t index, float openness, Scratch& scratch) const {
  scratch.bounce_light.assign(scratch.bounce_points.size(), environment_.mean() * openness);
  PointsToLight at{scratch.bounce_points, scratch.bounce_places, {}, scratch.bounce_light, {}};
  at.by_chance = false;
  add_aimed(at, {}, index, kBounceDimension, scratch);
  for (std::size_t i = 0; i < scratch.bounce_points.size(); ++i) {
    const Material& material = scratch.bounce_materials[i];
    Vec3f& sum = scratch.arriving[scratch.bounce_points[i].ray];
    sum = sum + at_most(material.matt_color() * scratch.bounce_light[i] * material.alpha, kMostBounced);
  }
}

}  // namespace perfect_bvh
