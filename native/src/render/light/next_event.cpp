#include "render/light/next_event.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/surface/surface.h"

namespace perfect_bvh {
namespace {

// Surfaces seen by the camera sample each of a few lights, or two of many. Later surfaces sample one: a ray to each at
// each bounce would take most of the time and contribute little of the light.
constexpr std::size_t kFewLights = 4;
constexpr std::uint8_t kPicksSeen = 2, kPicks = 1;
// Rays test every light for a hit; if there are more than this, none.
constexpr std::size_t kMostMet = 64;
// Rays end just before the light, so that a mesh around it does not block it.
constexpr float kShort = 1.0f - 1e-5f;
// Dimensions after those of the lights.
constexpr std::uint32_t kEmissiveDimensions = 8, kSkyDimension = 10;

bool is_black(Vec3f color) noexcept { return !(color.x > 0.0f || color.y > 0.0f || color.z > 0.0f); }

float guess(const Light& light, Vec3d point, Vec3f normal, bool transmits) noexcept {
  const float front = guess_light(light, point, normal);
  return transmits ? std::max(front, guess_light(light, point, -normal)) : front;
}

LightRay look(const Light& light, const Vertex& vertex, Point2 random) noexcept {
  const SurfacePoint& point = vertex.point;
  const LightRay ray = look_at_light(light, point.origin, vertex.path.normal, random);
  if (!vertex.bsdf.transmits() || !is_black(ray.light)) return ray;
  return look_at_light(light, point.beyond, -vertex.path.normal, random);
}

// The share of light from a direction that falls on the surface; for strands, all of it.
float slant_of(const Vertex& vertex, Vec3f direction) noexcept {
  return vertex.bsdf.is_strand() ? 1.0f : std::abs(dot(direction, vertex.point.light_normal));
}

}  // namespace

NextEvent::NextEvent(const Snapshot& snapshot, const Appearance& appearance, const Environment& environment,
                     std::uint32_t seed)
    : appearance_(appearance),
      environment_(environment),
      seed_(seed),
      emissive_(snapshot, appearance),
      any_met_(appearance.lights.size() <= kMostMet &&
               std::any_of(appearance.lights.begin(), appearance.lights.end(),
                           [this](const Light& light) { return can_be_met(light); })) {}

std::uint8_t NextEvent::picks_of(const Path& path) const noexcept {
  if (!path.is_seen()) return kPicks;
  return appearance_.lights.size() <= kFewLights ? kAll : kPicksSeen;
}

void NextEvent::aim(std::span<Vertex> vertices, std::uint32_t index, std::uint32_t first_dimension,
                    std::vector<float>& guesses, ShadowRays& shadows) const {
  bool any_all = false, any_some = false;
  for (Vertex& vertex : vertices) {
    vertex.path.normal = vertex.bsdf.is_strand() ? Vec3f{0, 0, 0} : vertex.point.light_normal;
    vertex.path.transmits = vertex.bsdf.transmits();
    vertex.path.meets_lights = any_met_;
    vertex.path.picks = picks_of(vertex.path);
    (vertex.path.picks == kAll ? any_all : any_some) = true;
  }
  if (any_all) aim_at_each(vertices, index, first_dimension, shadows);
  if (any_some) aim_at_some(vertices, index, first_dimension, guesses, shadows);
  if (!emissive_.empty()) aim_at_emissive(vertices, index, first_dimension + kEmissiveDimensions, shadows);
  if (environment_.can_be_aimed_at()) aim_at_sky(vertices, index, first_dimension + kSkyDimension, shadows);
}

// Light by light, so that consecutive rays have similar directions.
void NextEvent::aim_at_each(std::span<Vertex> vertices, std::uint32_t index, std::uint32_t first_dimension,
                            ShadowRays& shadows) const {
  for (std::uint32_t number = 0; number < appearance_.lights.size(); ++number) {
    const Dimension dimension(seed_, first_dimension + number);
    const FixedPoint2 shared = dimension.sample(index);
    for (std::uint32_t row = 0; row < vertices.size(); ++row) {
      if (vertices[row].path.picks != kAll) continue;
      const Point2 random = (shared ^ dimension.offset(vertices[row].path.place)).to_unit();
      aim_at(vertices[row], row, appearance_.lights[number], random, 1.0f, shadows);
    }
  }
}

void NextEvent::aim_at_some(std::span<Vertex> vertices, std::uint32_t index, std::uint32_t first_dimension,
                            std::vector<float>& guesses, ShadowRays& shadows) const {
  const std::vector<Light>& lights = appearance_.lights;
  guesses.resize(lights.size());
  const Dimension choice(seed_, first_dimension), first(seed_, first_dimension + 1), second(seed_, first_dimension + 2);
  for (std::uint32_t row = 0; row < vertices.size(); ++row) {
    Vertex& vertex = vertices[row];
    Path& path = vertex.path;
    if (path.picks == kAll) continue;
    const auto picks = static_cast<float>(path.picks);
    float sum = 0.0f;
    for (std::size_t i = 0; i < lights.size(); ++i) {
      sum += guess(lights[i], vertex.point.origin, path.normal, path.transmits);
      guesses[i] = sum;
    }
    const bool any = sum > 0.0f && std::isfinite(sum);
    path.guess_sum = any ? sum : 0.0f;
    if (!any) continue;
    const Point2 chosen = (choice.sample(index) ^ choice.offset(path.place)).to_unit();
    for (int pick = 0; pick < path.picks; ++pick) {
      const float wanted = sum * (static_cast<float>(pick) + chosen.x) / picks;
      const auto found = std::upper_bound(guesses.begin(), guesses.end() - 1, wanted);
      const auto number = static_cast<std::size_t>(found - guesses.begin());
      const float part = guesses[number] - (number > 0 ? guesses[number - 1] : 0.0f);
      if (!(part > 0.0f)) continue;
      const Dimension& dimension = pick == 0 ? first : second;
      const Point2 random = (dimension.sample(index) ^ dimension.offset(path.place)).to_unit();
      aim_at(vertex, row, lights[number], random, picks * part / sum, shadows);
    }
  }
}

void NextEvent::aim_at(const Vertex& vertex, std::uint32_t row, const Light& light, Point2 random, float tries,
                       ShadowRays& shadows) const {
  const LightRay to_light = look(light, vertex, random);
  if (is_black(to_light.light)) return;
  const Bsdf::Value seen = vertex.bsdf.evaluate(to_light.direction);
  const bool may_be_met = any_met_ && can_be_met(light);
  const float counts = may_be_met ? balance(to_light.density * tries, seen.density) : 1.0f;
  const Vec3f carried = vertex.path.throughput * to_light.light * seen.share * (counts / tries);
  if (is_black(carried)) return;
  // A light that casts no shadow is never blocked.
  const float reach = light.casts_shadow ? to_light.length * kShort : -1.0f;
  shadows.add(shadow_ray(vertex.point, to_light.direction, reach, appearance_.shadow_mask), row, carried);
}

Vec3f NextEvent::meet_lights(const Path& path, const Ray& ray, float hit_t) const {
  Vec3f sum{0, 0, 0};
  const Vec3f direction = to_float(ray.direction);
  for (const Light& light : appearance_.lights) {
    if (!can_be_met(light)) continue;
    const std::optional<LightMet> met = meet_light(light, ray.origin, direction);
    if (!met || met->length > hit_t || met->length < ray.t_min) continue;
    float tries = 1.0f;
    if (path.picks != kAll) {
      const float part = guess(light, ray.origin, path.normal, path.transmits);
      tries = path.guess_sum > 0.0f ? static_cast<float>(path.picks) * part / path.guess_sum : 0.0f;
    }
    sum = sum + met->radiance * balance(path.density, met->density * tries);
  }
  return sum;
}

void NextEvent::aim_at_emissive(std::span<const Vertex> vertices, std::uint32_t index, std::uint32_t first_dimension,
                                ShadowRays& shadows) const {
  const Dimension choice(seed_, first_dimension), place(seed_, first_dimension + 1);
  for (std::uint32_t row = 0; row < vertices.size(); ++row) {
    const Vertex& vertex = vertices[row];
    const std::uint32_t own = vertex.path.place;
    const Point2 pick = (choice.sample(index) ^ choice.offset(own)).to_unit();
    const EmissivePoint light =
        emissive_.choose(pick.x, (place.sample(index) ^ place.offset(own)).to_unit(), vertex.point.time);
    const Vec3f way = to_float(light.position - vertex.point.origin);
    const float distance = length(way);
    if (!(distance > 0.0f) || !std::isfinite(distance)) continue;
    const Vec3f direction = way * (1.0f / distance);
    const float density = light.density * distance * distance / std::abs(dot(direction, light.normal));
    if (!std::isfinite(density) || !(density > 0.0f)) continue;
    const bool mirrored = (light.mask & appearance_.glossy_mask) != 0;
    const Bsdf::Value seen = mirrored ? vertex.bsdf.evaluate(direction) : vertex.bsdf.evaluate_diffuse(direction);
    const float share = slant_of(vertex, direction) * std::numbers::inv_pi_v<float> / (density + seen.density);
    const Vec3f carried = vertex.path.throughput * light.radiance * seen.share * share;
    if (is_black(carried)) continue;
    shadows.add(shadow_ray(vertex.point, direction, distance * kShort, appearance_.shadow_mask), row, carried);
  }
}

void NextEvent::aim_at_sky(std::span<const Vertex> vertices, std::uint32_t index, std::uint32_t dimension,
                           ShadowRays& shadows) const {
  const Dimension place(seed_, dimension);
  const FixedPoint2 shared = place.sample(index);
  for (std::uint32_t row = 0; row < vertices.size(); ++row) {
    const Vertex& vertex = vertices[row];
    const BrightSky::Choice sky = environment_.aim((shared ^ place.offset(vertex.path.place)).to_unit());
    const Bsdf::Value seen = vertex.bsdf.evaluate(sky.direction);
    const float share = slant_of(vertex, sky.direction) * std::numbers::inv_pi_v<float> / (sky.density + seen.density);
    const Vec3f carried = vertex.path.throughput * environment_.parts(sky.direction).bright * seen.share * share;
    if (is_black(carried)) continue;
    shadows.add(shadow_ray(vertex.point, sky.direction, kInfiniteDistance, appearance_.shadow_mask), row, carried);
  }
}

// Secondary rays ------------------------------------------------------------------------------------------------------

namespace {

// Each transparent surface takes its share, until nothing is left or nothing is in the way.
void pass_layers(const Snapshot& snapshot, const Appearance& appearance, std::span<const Vertex> vertices,
                 int most_layers, CancelToken& cancel, ShadowRays& shadows) {
  for (int layer = 0; layer <= most_layers; ++layer) {
    shadows.hits.resize(shadows.rays.size());
    trace_closest(snapshot, cancel, shadows.rays, shadows.hits);
    bool goes_on = false;
    for (std::size_t i = 0; i < shadows.rays.size(); ++i) {
      const Hit& hit = shadows.hits[i];
      Ray& ray = shadows.rays[i];
      if (!hit.found()) {
        ray.t_min = 1.0f, ray.t_max = 0.0f;  // done: such a ray hits nothing
        continue;
      }
      const Instance& instance = snapshot.instances[hit.instance_index];
      const std::int32_t material = appearance.material_of(instance, hit.primitive_index);
      const bool is_last = layer + vertices[shadows.vertices[i]].path.transparent >= most_layers;
      const float passes = is_last ? 0.0f : 1.0f - alpha_at(snapshot, appearance, ray, hit, material);
      shadows.passed[i] *= std::max(passes, 0.0f);
      ray.t_min = std::nextafter(hit.t, kInfiniteDistance);
      if (!(shadows.passed[i] > 0.0f)) ray.t_max = -1.0f;
      goes_on = true;
    }
    if (!goes_on) return;
  }
}

}  // namespace

bool begin_at_meshes(const Snapshot& snapshot, CancelToken& cancel, std::span<Ray> rays) {
  std::vector<std::size_t> rows;
  AlignedVector<Ray> starts;
  AlignedVector<Hit> hits;
  for (std::size_t row = 0; row < rays.size(); ++row) {
    if (!(rays[row].t_min > 0.0f) || rays[row].t_max < 0.0f) continue;
    Ray& start = starts.emplace_back(rays[row]);
    start.t_max = std::min(start.t_min, start.t_max), start.t_min = 0.0f;
    rows.push_back(row);
  }
  if (starts.empty()) return false;
  while (!starts.empty()) {
    hits.assign(starts.size(), Hit{});
    trace_closest(snapshot, cancel, starts, hits);
    std::size_t left = 0;
    for (std::size_t i = 0; i < starts.size(); ++i) {
      if (!hits[i].found()) continue;
      if (snapshot.instances[hits[i].instance_index].blas->mesh.shape != CurveShape::kRibbon) {
        rays[rows[i]].t_min = hits[i].t;
        continue;
      }
      starts[left] = starts[i], rows[left] = rows[i];
      starts[left++].t_min = std::nextafter(hits[i].t, kInfiniteDistance);
    }
    starts.resize(left), rows.resize(left);
  }
  return true;
}

void find_what_passes(const Snapshot& snapshot, const Appearance& appearance, std::span<const Vertex> vertices,
                      int most_layers, CancelToken& cancel, ShadowRays& shadows) {
  shadows.passed.assign(shadows.rays.size(), 1.0f);
  if (appearance.any_transparent()) {
    begin_at_meshes(snapshot, cancel, shadows.rays);
    return pass_layers(snapshot, appearance, vertices, most_layers, cancel, shadows);
  }
  shadows.blocked.resize(shadows.rays.size());
  trace_occluded(snapshot, cancel, shadows.rays, shadows.blocked);
  for (std::size_t i = 0; i < shadows.rays.size(); ++i) {
    if (shadows.blocked[i] != 0) shadows.passed[i] = 0.0f, shadows.rays[i].t_max = -1.0f;
  }
  if (!begin_at_meshes(snapshot, cancel, shadows.rays)) return;
  for (std::size_t i = 0; i < shadows.rays.size(); ++i) {
    const float width = vertices[shadows.vertices[i]].point.ribbon_width;
    if (shadows.rays[i].t_min < width) shadows.passed[i] = 0.0f;  // a mesh
  }
}

}  // namespace perfect_bvh
