// Matt clay in a studio: a soft sky dimmed by ambient occlusion, and a soft key light that throws short shadows.
// Occlusion reaches a limited distance and fades towards it, by giving every ray a random length (an unbiased form of
// the obscurances of Zhukov et al. 1998): rays stay short and of the any-hit kind, and rooms stay light.
#include <numbers>

#include "render/sampler.h"
#include "render/shading.h"
#include "render/studio.h"

namespace perfect_bvh {
namespace {

// How far light is kept away, in parts of the scene's diagonal.
constexpr float kDefaultReach = 0.35f;
// The key light's shadows are longer than the sky's.
constexpr float kKeyReach = 2.5f;
// What a blocked direction still gives, in parts of the surface's own colour and the dome's mean: light that has
// bounced between near surfaces.
constexpr float kBounce = 0.32f;

float default_distance(const Snapshot& snapshot) noexcept {
  const Aabb bounds = snapshot.tlas.bounds();
  return bounds.is_empty() ? 1.0f : std::max(length(bounds.extent()) * kDefaultReach, 1e-30f);
}

// Two unit vectors that make a right-handed frame with the unit vector z (Duff et al. 2017).
struct Frame {
  Vec3f x, y, z;
  explicit Frame(Vec3f axis) noexcept : z(axis) {
    const float sign = std::copysign(1.0f, axis.z);
    const float a = -1.0f / (sign + axis.z), b = axis.x * axis.y * a;
    x = {1.0f + sign * axis.x * axis.x * a, sign * b, -sign * axis.x};
    y = {b, sign + axis.y * axis.y * a, -axis.y};
  }
  [[nodiscard]] Vec3f world(Vec3f v) const noexcept { return x * v.x + y * v.y + z * v.z; }
};

// Uniform over the disk; equal areas stay together, so an even set of points stays even (Shirley and Chiu 1997).
Point2 disk(Point2 uniform) noexcept {
  const float a = 2.0f * uniform.x - 1.0f, b = 2.0f * uniform.y - 1.0f;
  if (a == 0.0f && b == 0.0f) return {0.0f, 0.0f};
  constexpr float kQuarter = std::numbers::pi_v<float> / 4.0f;
  const bool wide = std::abs(a) > std::abs(b);
  const float radius = wide ? a : b;
  const float angle = wide ? kQuarter * (b / a) : 2.0f * kQuarter - kQuarter * (a / b);
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

class ClayMode final : public ShadingMode {
 public:
  explicit ClayMode(const ModeInputs& inputs)
      : snapshot_(inputs.snapshot),
        settings_(inputs.settings.clay),
        studio_(inputs.camera),
        key_frame_(studio_.key_direction),
        shadow_mask_(inputs.appearance.shadow_mask),
        reach_(settings_.ao_distance > 0.0f ? settings_.ao_distance : default_distance(snapshot_)),
        sky_(inputs.settings.seed, 1),
        length_(inputs.settings.seed, 2),
        key_(inputs.settings.seed, 3) {}

  [[nodiscard]] SurfaceNeeds needs() const noexcept override {
    return {.normals = true, .origins = true, .materials = !settings_.color};
  }
  [[nodiscard]] bool has_backdrop() const noexcept override { return true; }

  void shade(const ShadeTask& task) const override {
    ShadeScratch& scratch = task.scratch;
    scratch.light.assign(task.points.size(), Vec3f{0, 0, 0});
    const auto count = static_cast<std::uint32_t>(settings_.light_rays);
    for (std::uint32_t i = 0; i < count; ++i) {
      scratch.rays.clear(), scratch.targets.clear();
      add_rays(task, task.sample * count + i);
      scratch.occluded.resize(scratch.rays.size());
      trace_occluded(snapshot_, scratch.rays, scratch.occluded);
      for (std::size_t row = 0; row < scratch.targets.size(); ++row) {
        const LightRayTarget& target = scratch.targets[row];
        scratch.light[target.point] =
            scratch.light[target.point] + (scratch.occluded[row] != 0 ? target.if_blocked : target.if_open);
      }
    }
    const float share = 1.0f / static_cast<float>(count);
    for (std::size_t row = 0; row < task.points.size(); ++row) {
      const Vec3f color = color_of(task.points[row]) * scratch.light[row] * share;
      task.colors[task.points[row].ray] = {color.x, color.y, color.z, 1.0f};
    }
  }

 private:
  [[nodiscard]] Vec3f color_of(const SurfacePoint& point) const noexcept {
    return settings_.color ? *settings_.color : point.color;
  }

  // A ray to the sky and, where it shines, one to the key light, for each point.
  void add_rays(const ShadeTask& task, std::uint32_t index) const {
    const FixedPoint2 sky = sky_.sample(index), lengths = length_.sample(index), key = key_.sample(index);
    for (std::uint32_t row = 0; row < task.points.size(); ++row) {
      const SurfacePoint& point = task.points[row];
      const Pixel pixel = task.pixels[point.ray];
      const std::uint32_t place = sampling::z_order(pixel.x, pixel.y);
      const Point2 parts = (lengths + length_.offset(place)).to_unit();
      add_sky_ray(task.scratch, row, point, (sky + sky_.offset(place)).to_unit(), parts.x);
      add_key_ray(task.scratch, row, point, (key + key_.offset(place)).to_unit(), parts.y);
    }
  }

  void add_sky_ray(ShadeScratch& scratch, std::uint32_t row, const SurfacePoint& point, Point2 uniform,
                   float part) const {
    const Point2 flat = disk(uniform);
    const float height = std::sqrt(std::max(0.0f, 1.0f - flat.x * flat.x - flat.y * flat.y));
    const Vec3f direction = above(point, Frame(point.normal).world({flat.x, flat.y, height}));
    const Vec3f bounced = color_of(point) * Studio::dome_mean(point.normal.z) * kBounce;
    add_ray(scratch, point, direction, reach_, part, {row, Studio::dome(direction.z), bounced});
  }

  void add_key_ray(ShadeScratch& scratch, std::uint32_t row, const SurfacePoint& point, Point2 uniform,
                   float part) const {
    const Point2 flat = disk(uniform);
    const Vec3f direction =
        normalized(key_frame_.world({flat.x * Studio::kKeyRadius, flat.y * Studio::kKeyRadius, 1.0f}));
    const float cosine = dot(direction, point.normal);
    if (cosine <= 0.0f || (!point.lifted && dot(direction, point.geometric_normal) <= 0.0f)) return;
    add_ray(scratch, point, direction, reach_ * kKeyReach, part, {row, Studio::kKey * cosine, Vec3f{0, 0, 0}});
  }

  // A surface blocks a ray with a probability that falls to zero, with zero slope, over `reach`.
  void add_ray(ShadeScratch& scratch, const SurfacePoint& point, Vec3f direction, float reach, float part,
               LightRayTarget target) const {
    Ray ray;
    ray.origin = point.origin;
    ray.direction = to_double(direction);
    ray.t_max = reach * (1.0f - std::sqrt(part));
    ray.mask = shadow_mask_;
    scratch.rays.push_back(ray);
    scratch.targets.push_back(target);
  }

  // Directions round a smooth normal may dip below the triangle. From a point lifted off it they pass over its
  // neighbours; from the triangle itself they would end in it, and are mirrored.
  static Vec3f above(const SurfacePoint& point, Vec3f direction) noexcept {
    const float height = dot(direction, point.geometric_normal);
    if (height >= 0.0f || point.lifted) return direction;
    return direction - point.geometric_normal * (2.0f * height);
  }

  const Snapshot& snapshot_;
  ClaySettings settings_;
  Studio studio_;
  Frame key_frame_;
  std::uint32_t shadow_mask_;
  float reach_;
  Dimension sky_, length_, key_;
};

}  // namespace

std::unique_ptr<ShadingMode> make_clay_mode(const ModeInputs& inputs) { return std::make_unique<ClayMode>(inputs); }

}  // namespace perfect_bvh
