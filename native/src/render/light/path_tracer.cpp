#include "render/light/path_tracer.h"

#include <algorithm>
#include <cmath>

#include "math/elementary.h"
#include "query/trace.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {
namespace {

constexpr float kLeastThrough = 1 / 256.0f;  // of transparent surfaces: less cannot be seen
// Dimensions of each depth: the choice of the lobe and of ending the path, the direction, the choice at a transparent
// surface, next-event estimation. The camera's come before them.
constexpr std::uint32_t kFirstDimension = 16, kPickDimension = 0, kDirectionDimension = 1, kPassDimension = 2;
constexpr std::uint32_t kLightDimension = 3;
constexpr std::uint32_t kDimensionsPerDepth = kLightDimension + NextEvent::kDimensions;
constexpr int kSureBounces = 2;  // before any path is ended by chance

float largest(Vec3f color) noexcept { return std::max({color.x, color.y, color.z}); }

}  // namespace

PathTracer::PathTracer(const Snapshot& snapshot, const Appearance& appearance, const LightPaths& limits,
                       std::uint32_t seed, int threads, CancelToken& cancel)
    : snapshot_(snapshot),
      cancel_(cancel),
      appearance_(appearance),
      limits_(limits),
      seed_(seed),
      environment_(appearance, threads),
      next_event_(snapshot, appearance, environment_, seed) {}

void PathTracer::follow(std::uint32_t sample, const PathTargets& targets, Scratch& scratch) const {
  scratch.next.clear(), scratch.caught.clear();
  const Step first{sample, kFirstDimension, targets};
  see_surfaces(first, scratch);
  follow(sample, 1, targets, scratch);
}

// From `next` on.
void PathTracer::follow(std::uint32_t sample, int depth, const PathTargets& targets, Scratch& scratch) const {
  Wave& wave = scratch.wave;
  constexpr SurfaceNeeds kAll{.normals = true, .origins = true, .materials = true, .holdouts = true};
  for (; !scratch.next.paths.empty(); ++depth) {
    std::swap(wave, scratch.next);
    scratch.next.clear();
    wave.hits.resize(wave.rays.size());
    trace_closest(snapshot_, cancel_, wave.rays, wave.hits);
    if (appearance_.any_absorbing()) absorb(wave);
    const Step step{sample, kFirstDimension + kDimensionsPerDepth * static_cast<std::uint32_t>(depth), targets};
    see_lights(step, wave);
    see_environment(step, wave);
    find_surfaces(snapshot_, appearance_, kAll, wave.rays, wave.hits, wave.points);
    see_surfaces(step, scratch);
  }
}

Vec3f PathTracer::clamped(Vec3f color, int bounces) const noexcept {
  const float most = bounces > 0 ? limits_.clamp_indirect : limits_.clamp_direct;
  const float sum = color.x + color.y + color.z;
  return most > 0.0f && sum > 3.0f * most ? color * (3.0f * most / sum) : color;
}

// A material whose emission is not a number shows nothing.
void PathTracer::add(const Step& step, const Path& path, Vec3f color, int bounces) const {
  if (!is_finite(color)) return;
  const Vec3f bright = clamped(color, bounces);
  Rgba& to = step.targets.colors[path.owner];
  to = {to.r + bright.x, to.g + bright.y, to.b + bright.z, to.a};
}

// Absorption by the law of Beer and Lambert. Lights inside a medium are treated as far away as the surface behind them.
void PathTracer::absorb(Wave& wave) const {
  for (std::size_t row = 0; row < wave.paths.size(); ++row) {
    Path& path = wave.paths[row];
    if (path.absorption == Vec3f{0, 0, 0}) continue;
    const double length =
        static_cast<double>(wave.hits[row].t) - static_cast<double>(std::max(wave.rays[row].t_min, 0.0f));
    const auto left = [&](float absorbed) {
      return absorbed > 0.0f ? static_cast<float>(exponential(-static_cast<double>(absorbed) * length)) : 1.0f;
    };
    const Vec3f share{left(path.absorption.x), left(path.absorption.y), left(path.absorption.z)};
    path.throughput = path.throughput * share, path.guide_throughput = path.guide_throughput * share;
  }
}

void PathTracer::cross_border(Path& path, const SurfacePoint& point) const noexcept {
  if (appearance_.any_absorbing()) {
    path.absorption = point.inside ? Vec3f{0, 0, 0} : appearance_.absorption_of(point.material);
  }
}

void PathTracer::see_lights(const Step& step, Wave& wave) const {
  for (std::size_t row = 0; row < wave.paths.size(); ++row) {
    const Path& path = wave.paths[row];
    if (!path.meets_lights) continue;
    const Vec3f light = next_event_.meet_lights(path, wave.rays[row], wave.hits[row].t);
    add(step, path, path.throughput * light, path.bounces - 1);
  }
}

void PathTracer::see_environment(const Step& step, const Wave& wave) const {
  for (std::size_t row = 0; row < wave.paths.size(); ++row) {
    if (wave.hits[row].found()) continue;
    const Path& path = wave.paths[row];
    const Vec3f direction = to_float(normalized(wave.rays[row].direction));
    if (path.is_seen()) {
      if (appearance_.film_transparent) continue;
      const Vec3f color = environment_.backdrop(direction);
      add(step, path, path.throughput * color, 0);
      step.targets.colors[path.owner].a += path.throughput.x;
      guide(step, path, color, {0, 0, 0});
      continue;
    }
    auto [light, bright] = environment_.parts(direction);
    guide(step, path, light + bright, {0, 0, 0});
    if (largest(bright) > 0.0f) light = light + bright * balance(path.density, environment_.density(direction));
    add(step, path, path.throughput * light, path.bounces - 1);
  }
}

void PathTracer::see_surfaces(const Step& step, Scratch& scratch) const {
  scratch.vertices.clear();
  Wave& wave = scratch.wave;
  if (appearance_.programs.empty()) {
    for (const SurfacePoint& point : wave.points) {
      Material material =
          material_at(snapshot_, appearance_, wave.rays[point.ray], wave.hits[point.ray], point.material);
      see_surface(step, point, material, scratch);
    }
  } else {
    for (SurfacePoint& point : wave.points) {
      const Path& path = wave.paths[point.ray];
      if (!path.is_seen()) point.pixel = path.pixel + path.spread * static_cast<double>(wave.hits[point.ray].t);
    }
    const std::span<Material> materials =
        scratch.materials.read(snapshot_, appearance_, wave.rays, wave.hits, wave.points);
    for (std::size_t i = 0; i < materials.size(); ++i) see_surface(step, wave.points[i], materials[i], scratch);
  }
  light_vertices(step, scratch);
  scatter(step, scratch);
}

// Adds the surface's emission and the light passing through it, and makes a vertex if something is scattered there. For
// camera rays the path is split, so that the result is exact; otherwise one part is chosen by chance.
void PathTracer::see_surface(const Step& step, const SurfacePoint& point, Material& material, Scratch& scratch) const {
  const Wave& wave = scratch.wave;
  Path path = wave.paths[point.ray];
  const Ray& ray = wave.rays[point.ray];
  const Hit& hit = wave.hits[point.ray];
  const Instance& instance = snapshot_.instances[hit.instance_index];
  if (path.is_seen() && appearance_.is_holdout(instance, hit.primitive_index)) return;
  const Vec3f view = to_float(-normalized(ray.direction));
  if (path.is_seen() && appearance_.is_catcher(instance)) {
    return scratch.caught.push_back({point, view, path.owner, path.place, path.throughput.x});
  }
  const bool is_hair = material.hair != nullptr && !(point.along == Vec3f{0, 0, 0});
  if (is_hair && point.inside) return pass_hair(path, ray, hit, scratch.next);
  if (is_hair) material.surface = material.hair->surface;
  const float through = std::clamp(material.through(), 0.0f, 1.0f);
  if (through > 0.0f) {
    if (path.is_seen()) {
      pass(path, ray, hit, point, through, scratch.next);
      path.throughput = path.throughput * (1.0f - through);
      path.guide_throughput = path.guide_throughput * (1.0f - through);
    } else {
      const Dimension dimension(seed_, step.first_dimension + kPassDimension);
      const Point2 chance = (dimension.sample(step.sample) ^ dimension.offset(path.place)).to_unit();
      if (chance.x < through) return pass(path, ray, hit, point, 1.0f, scratch.next);
    }
  }
  if (path.is_seen()) step.targets.colors[path.owner].a += path.throughput.x * (1.0f - material.holdout);
  add(step, path, path.throughput * emitted(path, ray, hit, point, material), std::max(path.bounces - 1, 0));
  if (path.ends || material.holdout >= 1.0f) return;
  if (!appearance_.programs.empty()) widen(path, ray, point, hit.t);
  const Bsdf::Limits limits = limits_of(path);
  if (material.finish && material.coat_normal == Vec3f{0, 0, 0}) material.coat_normal = point.mesh_normal;
  Vertex& vertex = scratch.vertices.emplace_back(point, material, view, limits, path);
  if (!(point.light_normal == point.mesh_normal)) vertex.bsdf.set_mesh_normal(point.mesh_normal);
  if (is_hair) {
    vertex.bsdf.add_hair(
        {*material.hair, material.color, {point.along, point.geometric_normal, view}, limits.least_alpha});
    vertex.point.strand = &instance, vertex.point.segment = hit.primitive_index;
  }
  guide_by(step, vertex.bsdf, point, material.emission, vertex.path);
  if (vertex.bsdf.is_black()) scratch.vertices.pop_back();
}

// A pixel grows with the length of its whole path, as in Cycles, also where a surface scatters it.
void PathTracer::widen(Path& path, const Ray& ray, const SurfacePoint& point, float t) const {
  if (!path.is_seen()) {
    path.pixel = point.pixel;
  } else if (appearance_.view) {
    const RayMaker& rays = appearance_.view->rays;
    const Vec3d way = ray.direction * static_cast<double>(t);
    path.pixel = rays.pixel_size(way), path.spread = rays.orthographic() ? 0.0 : path.pixel / length(way);
  }
}

// Hair has no inner side, as in Cycles: a viewer is always outside.
void PathTracer::pass_hair(const Path& path, const Ray& ray, const Hit& hit, Wave& next) const {
  Ray rest = ray;
  rest.t_min = std::nextafter(hit.t, kInfiniteDistance);
  next.add(path, rest);
}

Vec3f PathTracer::emitted(const Path& path, const Ray& ray, const Hit& hit, const SurfacePoint& point,
                          const Material& material) const {
  if (!(largest(material.emission) > 0.0f) || path.is_seen()) return material.emission;
  const Instance& instance = snapshot_.instances[hit.instance_index];
  const float chosen = next_event_.emissive().density(instance, point.material);
  if (!(chosen > 0.0f)) return material.emission;
  const float slant = std::abs(dot(to_float(ray.direction), point.geometric_normal));
  return material.emission * balance(path.density, chosen * hit.t * hit.t / slant);
}

// Continues behind the surface.
void PathTracer::pass(Path behind, const Ray& ray, const Hit& hit, const SurfacePoint& point, float share,
                      Wave& next) const {
  cross_border(behind, point);
  behind.throughput = behind.throughput * share, behind.guide_throughput = behind.guide_throughput * share;
  if (!(largest(behind.throughput) > (behind.is_seen() ? kLeastThrough : 0.0f))) return;
  if (++behind.transparent > limits_.transparent_bounces) return;
  Ray rest = ray;
  rest.t_min = std::nextafter(hit.t, kInfiniteDistance);
  next.add(behind, rest);
}

void PathTracer::light_vertices(const Step& step, Scratch& scratch) const {
  ShadowRays& shadows = scratch.shadows;
  if (next_event_.empty() || scratch.vertices.empty()) return;
  shadows.clear();
  next_event_.aim(scratch.vertices, step.sample, step.first_dimension + kLightDimension, scratch.guesses, shadows);
  find_what_passes(snapshot_, appearance_, scratch.vertices, limits_.transparent_bounces, cancel_, shadows);
  for (std::size_t i = 0; i < shadows.rays.size(); ++i) {
    const Path& path = scratch.vertices[shadows.vertices[i]].path;
    if (shadows.passed[i] > 0.0f) add(step, path, shadows.carried[i] * shadows.passed[i], path.bounces);
  }
}

void PathTracer::scatter(const Step& step, Scratch& scratch) const {
  const Dimension picks(seed_, step.first_dimension + kPickDimension);
  const Dimension directions(seed_, step.first_dimension + kDirectionDimension);
  const FixedPoint2 pick = picks.sample(step.sample), direction = directions.sample(step.sample);
  const std::size_t passing = scratch.next.rays.size();
  for (const Vertex& vertex : scratch.vertices) {
    Path path = vertex.path;
    const Point2 chance = (pick ^ picks.offset(path.place)).to_unit();
    const Bsdf::Sample scattered = vertex.bsdf.sample(chance.x, (direction ^ directions.offset(path.place)).to_unit());
    if (!goes_on(path, scattered, chance.y)) continue;
    const bool goes_beyond = scattered.kind == Scatter::kTranslucent || scattered.kind == Scatter::kRefracted;
    // Light that leaves on one side of the smooth normal and on the other of the triangle is lost, as in Cycles.
    const bool is_below = dot(scattered.direction, vertex.point.geometric_normal) < 0.0f;
    if (!scattered.is_strand && is_below != goes_beyond) continue;
    if (goes_beyond) cross_border(path, vertex.point);
    scratch.next.add(path, ray_from(vertex.point, scattered.direction, kInfiniteDistance, mask_of(scattered.kind)));
  }
  begin_at_meshes(snapshot_, cancel_, std::span(scratch.next.rays).subspan(passing));
}

bool PathTracer::goes_on(Path& path, const Bsdf::Sample& scattered, float roulette) const {
  if (scattered.kind == Scatter::kNone || path.bounces == 255) return false;
  path.throughput = path.throughput * scattered.weight;
  path.density = scattered.density, path.last = scattered.kind;
  path.least_density = std::min(path.least_density, scattered.density);
  if (!(largest(path.throughput) > 0.0f) || !is_finite(path.throughput)) return false;
  const bool passes = scattered.kind == Scatter::kTranslucent || scattered.kind == Scatter::kRefracted;
  std::uint8_t& kind = passes ? path.transmission : scattered.kind == Scatter::kDiffuse ? path.diffuse : path.glossy;
  const int most = passes                                ? limits_.transmission_bounces
                   : scattered.kind == Scatter::kDiffuse ? limits_.diffuse_bounces
                                                         : limits_.glossy_bounces;
  path.ends = ++path.bounces > limits_.max_bounces || ++kind > most;
  if (path.ends || path.bounces <= kSureBounces) return true;
  const float stays = std::min(largest(path.throughput), 1.0f);
  if (!(roulette < stays)) return false;
  path.throughput = path.throughput * (1.0f / stays);
  return true;
}

// If a widely scattered ray finds light in a narrow lobe, that is rare and bright: the lobe is widened, as in Cycles.
Bsdf::Limits PathTracer::limits_of(const Path& path) const noexcept {
  Bsdf::Limits limits;
  if (path.is_seen()) return limits;
  const bool was_diffuse = path.last == Scatter::kDiffuse || path.last == Scatter::kTranslucent;
  limits.no_reflection = was_diffuse && !limits_.reflective_caustics;
  limits.no_refraction = was_diffuse && !limits_.refractive_caustics;
  if (!(limits_.filter_glossy > 0.0f)) return limits;
  const float blur = path.least_density / limits_.filter_glossy;
  if (blur < 1.0f) limits.least_alpha = 0.5f * std::sqrt(1.0f - blur);
  return limits;
}

std::uint32_t PathTracer::mask_of(Scatter kind) const noexcept {
  if (kind == Scatter::kDiffuse) return appearance_.diffuse_mask;
  return kind == Scatter::kGlossy ? appearance_.glossy_mask : appearance_.transmission_mask;
}

void PathTracer::guide(const Step& step, const Path& path, Vec3f albedo, Vec3f normal) const {
  if (!path.guides || step.targets.albedos.empty()) return;
  Vec3f &albedos = step.targets.albedos[path.owner], &normals = step.targets.normals[path.owner];
  const Vec3f share = path.guide_throughput;
  albedos = albedos + share * min(albedo, Vec3f{1, 1, 1});
  normals = normals + normal * ((share.x + share.y + share.z) / 3.0f);
}

// Guides come from the first surface that is not mostly a mirror or a pane; mirrors and panes are looked through.
void PathTracer::guide_by(const Step& step, const Bsdf& bsdf, const SurfacePoint& point, Vec3f emission,
                          Path& path) const {
  if (!path.guides) return;
  const Bsdf::Albedo albedo = bsdf.albedo();
  if (3.0f * albedo.plain_share < albedo.mirrored_share) {
    path.guide_throughput = path.guide_throughput * albedo.mirrored;
  } else {
    guide(step, path, albedo.plain + albedo.mirrored + emission, point.light_normal);
    path.guides = false;
  }
}

void PathTracer::light_white(std::span<const CaughtPoint> points, std::uint32_t sample, AlignedVector<Rgba>& light,
                             Scratch& scratch) const {
  light.assign(points.size(), Rgba{});
  const PathTargets targets{light, {}, {}};
  const Material white{.color = {1, 1, 1}};
  const Step first{sample, kFirstDimension, targets};
  scratch.vertices.clear(), scratch.next.clear();
  for (std::uint32_t row = 0; row < points.size(); ++row) {
    Path path;
    path.owner = row, path.place = points[row].place;
    const SurfacePoint& point = points[row].point;
    scratch.vertices.emplace_back(point, white, points[row].view, Bsdf::Limits{}, path);
  }
  light_vertices(first, scratch);
  scatter(first, scratch);
  follow(sample, 1, targets, scratch);
}

}  // namespace perfect_bvh
