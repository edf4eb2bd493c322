// Matt clay in a studio: a soft sky dimmed by ambient occlusion, and a soft key light that throws short shadows.
// What is near keeps light away and what is farther less so, to nothing at a limited distance (the obscurances of
// Zhukov et al. 1998): rays stay short and rooms stay light. A ray's nearest hit tells how much it keeps away: that has
// from a half to a ninth of the variance of asking yes or no over a random length, for 1.0 to 1.4 times the work.
#include "render/light/secondary_rays.h"
#include "render/light/studio.h"
#include "render/modes/shading.h"
#include "render/sampling/directions.h"

namespace perfect_bvh {
namespace {

constexpr float kDefaultReach = 0.35f;  // of occlusion, in diagonals of the scene
constexpr float kKeyReach = 2.5f;       // of the key light's shadows, in reaches of occlusion
// What a blocked direction still gives, in parts of the open dome and the colour of what blocks it: light that bounced.
constexpr float kBounce = 0.32f;

float default_distance(const Snapshot& snapshot) noexcept {
  const Aabb& box = snapshot.bounds;
  return box.is_empty() ? 1.0f : std::max(length(box.extent()) * kDefaultReach, 1e-30f);
}

class ClayMode final : public ShadingMode {
 public:
  explicit ClayMode(const ModeInputs& inputs)
      : snapshot_(inputs.snapshot),
        cancel_(inputs.cancel),
        appearance_(inputs.appearance),
        settings_(inputs.settings.clay),
        studio_(inputs.camera),
        key_frame_(studio_.key_direction),
        shadow_mask_(inputs.appearance.shadow_mask),
        reach_(settings_.ao_distance > 0.0f ? settings_.ao_distance : default_distance(snapshot_)),
        sky_(inputs.settings.seed, 1),
        key_(inputs.settings.seed, 2) {}

  [[nodiscard]] SurfaceNeeds needs() const noexcept override {
    return {.normals = true, .origins = true, .materials = !settings_.color};
  }
  [[nodiscard]] bool has_backdrop() const noexcept override { return true; }
  [[nodiscard]] Vec3f backdrop(const Ray& /*ray*/, float x, float y) const override { return Studio::backdrop(x, y); }

  void shade(const ShadeTask& task) const override {
    ShadeScratch& scratch = task.scratch;
    scratch.lights.assign(task.points.size(), StudioLight{});
    const auto count = static_cast<std::uint32_t>(settings_.light_rays);
    const float share = 1.0f / static_cast<float>(count);
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t index = task.sample * count + i;
      add_sky(task, index, share);
      add_key(task, index, share);
    }
    for (std::size_t row = 0; row < task.points.size(); ++row) {
      const SurfacePoint& point = task.points[row];
      const Vec3f color = lit(point.color, point.light_normal, scratch.lights[row]);
      task.colors[point.ray] = {color.x, color.y, color.z, 1.0f};
    }
  }

 private:
  [[nodiscard]] Vec3f lit(Vec3f color, Vec3f normal, const StudioLight& light) const noexcept {
    const Vec3f sky = max(light.sky, Vec3f{0, 0, 0});  // few rays may find more missing than there is
    return settings_.color.value_or(color) * (Studio::dome_mean(normal.z) * sky + Studio::kKey * light.key);
  }

  // One ray for each point, spread like the cosine over its hemisphere.
  void add_sky(const ShadeTask& task, std::uint32_t index, float share) const {
    ShadeScratch& scratch = task.scratch;
    const FixedPoint2 shared = sky_.sample(index);
    scratch.rays.clear();
    for (const SurfacePoint& point : task.points) {
      const Point2 random = (shared ^ sky_.offset(task.places[point.ray])).to_unit();
      const Vec3f direction = above(point, cosine_direction(point.light_normal, random));
      scratch.rays.push_back(shadow_ray(point, direction, reach_, shadow_mask_));
    }
    trace(scratch);
    for (std::size_t row = 0; row < task.points.size(); ++row) {
      // The open sky's mean is known, so rays only say what is missing from it: open places are free of noise.
      Vec3f sky{1, 1, 1};
      if (const Hit& hit = scratch.hits[row]; hit.found()) {
        const Vec3f mean = Studio::dome_mean(task.points[row].light_normal.z);
        const Vec3f dome = Studio::dome(static_cast<float>(scratch.rays[row].direction.z));
        const Vec3f lost = Vec3f{dome.x / mean.x, dome.y / mean.y, dome.z / mean.z} - color_at(hit) * kBounce;
        sky = sky - lost * obstruction(hit.t, reach_);
      }
      scratch.lights[row].sky = scratch.lights[row].sky + sky * share;
    }
  }

  // One ray to the key light's disk for each point that sees a part of it.
  void add_key(const ShadeTask& task, std::uint32_t index, float share) const {
    ShadeScratch& scratch = task.scratch;
    const FixedPoint2 shared = key_.sample(index);
    const float reach = reach_ * kKeyReach;
    scratch.rays.clear(), scratch.targets.clear();
    for (std::uint32_t row = 0; row < task.points.size(); ++row) {
      const SurfacePoint& point = task.points[row];
      if (!(studio_.key_cosine(point.light_normal) > 0.0f)) continue;
      const Point2 flat = uniform_disk((shared ^ key_.offset(task.places[point.ray])).to_unit());
      Vec3f direction = normalized(key_frame_.world({flat.x * Studio::kKeyRadius, flat.y * Studio::kKeyRadius, 1.0f}));
      // The part of the disk below the horizon gives nothing; its rays help to learn about the part above.
      const float cosine = dot(direction, point.light_normal);
      if (cosine < 0.0f) direction = direction - point.light_normal * (2.0f * cosine);
      scratch.rays.push_back(shadow_ray(point, above(point, direction), reach, shadow_mask_));
      scratch.targets.push_back(row);
    }
    trace(scratch);
    for (std::size_t i = 0; i < scratch.targets.size(); ++i) {
      const std::uint32_t row = scratch.targets[i];
      const Hit& hit = scratch.hits[i];
      const float visible = hit.found() ? 1.0f - obstruction(hit.t, reach) : 1.0f;
      scratch.lights[row].key += studio_.key_cosine(task.points[row].light_normal) * visible * share;
    }
  }

  void trace(ShadeScratch& scratch) const {
    scratch.hits.resize(scratch.rays.size());
    trace_closest(snapshot_, cancel_, scratch.rays, scratch.hits);
  }

  // How much of a direction's light something at t keeps away: all at 0, nothing at `reach`, without a kink there.
  static float obstruction(float t, float reach) noexcept {
    const float part = 1.0f - t / reach;
    return part * part;
  }

  [[nodiscard]] Vec3f color_at(const Hit& hit) const {
    if (settings_.color) return *settings_.color;
    return material_color(appearance_,
                          appearance_.material_of(snapshot_.instances[hit.instance_index], hit.primitive_index));
  }

  const Snapshot& snapshot_;
  CancelToken& cancel_;
  const Appearance& appearance_;
  ClaySettings settings_;
  Studio studio_;
  Frame key_frame_;
  std::uint32_t shadow_mask_;
  float reach_;
  Dimension sky_, key_;
};

}  // namespace

std::unique_ptr<ShadingMode> make_clay_mode(const ModeInputs& inputs) { return std::make_unique<ClayMode>(inputs); }

}  // namespace perfect_bvh
