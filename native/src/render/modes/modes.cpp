// Matt clay in a studio: a soft sky dimmed by ambient occlusion, and a soft key light with short shadows.
// Near surfaces block light, and farther ones less, down to nothing at a limited distance (the obscurances of Zhukov et
// al. 1998), so rays stay short and rooms stay bright. The blocked share is computed from a ray's nearest hit. That has
// from a half to a ninth of the variance of a yes-or-no test over a random length, for 1.0 to 1.4 times the work.
#include <algorithm>
#include <optional>

#include "core/errors.h"
#include "math/elementary.h"
#include "render/light/next_event.h"
#include "render/light/path_tracer.h"
#include "render/light/studio.h"
#include "render/modes/shading.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {
namespace {

constexpr float kDefaultReach = 0.35f;  // of occlusion, in diagonals of the scene
constexpr float kKeyReach = 2.5f;       // of the key light's shadows, in reaches of occlusion
// The light of a blocked direction, relative to the open dome and the colour of the blocking surface: bounced light.
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
    const Vec3f sky = max(light.sky, Vec3f{0, 0, 0});  // few rays may find more blocked light than there is
    return settings_.color.value_or(color) * (Studio::dome_mean(normal.z) * sky + Studio::kKey * light.key);
  }

  // One ray for each point, with a cosine distribution over its hemisphere.
  void add_sky(const ShadeTask& task, std::uint32_t index, float share) const {
    ShadeScratch& scratch = task.scratch;
    const FixedPoint2 shared = sky_.sample(index);
    scratch.rays.clear();
    for (const SurfacePoint& point : task.points) {
      const Point2 random = (shared ^ sky_.offset(task.places[point.ray])).to_unit();
      const Vec3f direction = cosine_direction(point.light_normal, random);
      scratch.rays.push_back(shadow_ray(point, direction, reach_, shadow_mask_));
    }
    trace(scratch);
    for (std::size_t row = 0; row < task.points.size(); ++row) {
      // The open sky's mean is known, so rays only measure the blocked part: open places have no noise.
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
      // The part of the disk below the horizon contributes nothing, but its rays help to estimate the part above.
      const float cosine = dot(direction, point.light_normal);
      if (cosine < 0.0f) direction = direction - point.light_normal * (2.0f * cosine);
      scratch.rays.push_back(shadow_ray(point, direction, reach, shadow_mask_));
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
    begin_at_meshes(snapshot_, cancel_, scratch.rays);
    scratch.hits.resize(scratch.rays.size());
    trace_closest(snapshot_, cancel_, scratch.rays, scratch.hits);
  }

  // The share of a direction's light that a surface at t blocks: all at 0, nothing at `reach`, with a smooth end.
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

// Mode matcap ---------------------------------------------------------------------------------------------------------
// Form at a glance: light that depends only on the normal in the viewer's frame, as if every surface were a part of
// one sphere photographed in a studio. A soft key light from the upper left, a cool fill from the right, a bright rim
// and a highlight are computed, not looked up in a picture. There are no shadows and no further rays: the cost is that
// of the normal.

namespace {

// In the viewer's frame: x to the right, y upwards, z towards the viewer. Unit length.
constexpr Vec3f kKeyDirection{-0.48f, 0.60f, 0.64f};
constexpr Vec3f kFillDirection{0.80f, -0.12f, 0.588f};
constexpr Vec3f kHalfway{-0.265f, 0.331f, 0.906f};  // between the key light and the viewer
constexpr Vec3f kAmbient{0.16f, 0.165f, 0.18f}, kKey{0.86f, 0.83f, 0.78f}, kFill{0.10f, 0.13f, 0.18f};
constexpr Vec3f kRim{0.20f, 0.22f, 0.25f}, kHighlight{0.30f, 0.295f, 0.285f};

Vec3f light_on(Vec3f normal, Vec3f color) noexcept {
  const float wrapped = 0.5f + 0.5f * dot(normal, kKeyDirection);  // reaches round to the far side
  const float fill = std::max(dot(normal, kFillDirection), 0.0f);
  const float edge = 1.0f - std::clamp(normal.z, 0.0f, 1.0f), shine = std::max(dot(normal, kHalfway), 0.0f);
  const Vec3f diffuse = color * (kAmbient + kKey * (wrapped * wrapped) + kFill * fill);
  return diffuse + kRim * (edge * edge * edge) + kHighlight * power(shine, 48.0f);
}

class MatcapMode final : public ShadingMode {
 public:
  explicit MatcapMode(const ModeInputs& inputs) : camera_(inputs.camera), color_(inputs.settings.clay.color) {}

  [[nodiscard]] SurfaceNeeds needs() const noexcept override { return {.normals = true, .materials = !color_}; }
  [[nodiscard]] bool has_backdrop() const noexcept override { return true; }
  [[nodiscard]] Vec3f backdrop(const Ray& /*ray*/, float x, float y) const override { return Studio::backdrop(x, y); }

  void shade(const ShadeTask& task) const override {
    for (const SurfacePoint& point : task.points) {
      const Vec3f color = light_on(as_seen(point.light_normal, task.rays[point.ray]), color_.value_or(point.color));
      task.colors[point.ray] = {color.x, color.y, color.z, 1.0f};
    }
  }

 private:
  // A normal in the frame of the ray that sees it, so that a sphere looks the same anywhere in the image.
  [[nodiscard]] Vec3f as_seen(Vec3f normal, const Ray& ray) const noexcept {
    const Vec3d towards = -normalized(ray.direction);
    Vec3d right = cross(camera_.up(), towards);
    right = length(right) > 1e-9 ? normalized(right) : camera_.right();  // a panorama looks straight up, too
    const Vec3d n = to_double(normal);
    return to_float(Vec3d{dot(n, right), dot(n, cross(towards, right)), dot(n, towards)});
  }

  const RayMaker& camera_;
  std::optional<Vec3f> color_;
};

}  // namespace

std::unique_ptr<ShadingMode> make_matcap_mode(const ModeInputs& inputs) { return std::make_unique<MatcapMode>(inputs); }

// Mode preview --------------------------------------------------------------------------------------------------------
// The final look of the scene: its materials under its own lights and world, by path tracing (light/path_tracer.h).

namespace {

class PreviewMode final : public ShadingMode {
 public:
  explicit PreviewMode(const ModeInputs& inputs)
      : appearance_(inputs.appearance),
        paths_(inputs.snapshot, inputs.appearance, inputs.settings.light_paths, inputs.settings.seed,
               inputs.settings.threads, inputs.cancel) {
    if (appearance_.catcher_mask == 0) return;
    const auto& instances = inputs.snapshot.instances;
    const auto catches = [&](const Instance& instance) { return appearance_.is_catcher(instance); };
    if (std::none_of(instances.begin(), instances.end(), catches)) return;
    catchers_ = appearance_;
    catchers_.shadow_mask = catchers_.diffuse_mask = catchers_.glossy_mask = catchers_.transmission_mask =
        appearance_.catcher_mask;
    open_.emplace(inputs.snapshot, catchers_, inputs.settings.light_paths, inputs.settings.seed,
                  inputs.settings.threads, inputs.cancel);
  }

  [[nodiscard]] SurfaceNeeds needs() const noexcept override {
    return {.normals = true, .origins = true, .materials = true};
  }
  [[nodiscard]] bool is_photograph() const noexcept override { return true; }
  [[nodiscard]] bool has_backdrop() const noexcept override { return true; }
  [[nodiscard]] bool has_guides() const noexcept override { return true; }
  [[nodiscard]] Vec3f backdrop(const Ray& ray, float x, float y) const override {
    if (!appearance_.world) return Studio::backdrop(x, y);
    return paths_.environment().backdrop(to_float(normalized(ray.direction)));
  }

  void shade(const ShadeTask& task) const override {
    PathTracer::Scratch& scratch = task.scratch.paths;
    Wave& wave = scratch.wave;
    wave.clear();
    for (std::uint32_t row = 0; row < task.rays.size(); ++row) {
      Path path;
      path.owner = row, path.place = task.places[row];
      path.guides = !task.albedos.empty();
      wave.add(path, task.rays[row]);
      if (path.guides && !task.hits[row].found()) guide_by_backdrop(task, row);
    }
    wave.hits.assign(task.hits.begin(), task.hits.end());
    wave.points.assign(task.points.begin(), task.points.end());
    paths_.follow(task.sample, {task.colors, task.albedos, task.normals}, scratch);
    if (open_ && !scratch.caught.empty()) show_shadows(task);
  }

 private:
  static void guide_by_backdrop(const ShadeTask& task, std::uint32_t row) {
    const Rgba& color = task.colors[row];
    task.albedos[row] = min(Vec3f{color.r, color.g, color.b}, Vec3f{1, 1, 1});
  }

  // Shadow catchers show the ratio of their light to the light that the same rays bring if only catchers exist: areas
  // without shadow have no noise. The mean of these ratios is shown, to which samples can be added later; Cycles uses
  // the ratio of the means. They differ where bounced light is more than the light that shadows remove.
  void show_shadows(const ShadeTask& task) const {
    ShadeScratch& scratch = task.scratch;
    const std::span<const CaughtPoint> caught = scratch.paths.caught;
    paths_.light_white(caught, task.sample, scratch.caught_light, scratch.caught_paths);
    open_->light_white(caught, task.sample, scratch.open_light, scratch.caught_paths);
    for (std::size_t i = 0; i < caught.size(); ++i) {
      const float bright = share_left(scratch.caught_light[i], scratch.open_light[i]), weight = caught[i].weight;
      Rgba& color = task.colors[caught[i].owner];
      if (appearance_.film_transparent) {
        color.a += weight * (1.0f - bright);
        continue;
      }
      const Vec3f seen = paths_.environment().backdrop(-caught[i].view) * (weight * bright);
      color = {color.r + seen.x, color.g + seen.y, color.b + seen.z, color.a + weight};
    }
  }

  // The mean over the channels.
  [[nodiscard]] static float share_left(const Rgba& light, const Rgba& open) noexcept {
    const auto share = [](float some, float all) { return all > 0.0f ? std::min(some / all, 1.0f) : 1.0f; };
    return (share(light.r, open.r) + share(light.g, open.g) + share(light.b, open.b)) / 3.0f;
  }

  const Appearance& appearance_;
  PathTracer paths_;
  Appearance catchers_;  // the same, but rays for light only hit shadow catchers
  std::optional<PathTracer> open_;
};

}  // namespace

std::unique_ptr<ShadingMode> make_preview_mode(const ModeInputs& inputs) {
  return std::make_unique<PreviewMode>(inputs);
}

// Shading -------------------------------------------------------------------------------------------------------------

std::unique_ptr<ShadingMode> make_mode(const ModeInputs& inputs) {
  switch (inputs.settings.mode) {
    case Mode::kPreview:
      return make_preview_mode(inputs);
    case Mode::kClay:
      return make_clay_mode(inputs);
    case Mode::kMatcap:
      return make_matcap_mode(inputs);
    case Mode::kUv:
      return make_uv_mode(inputs);
    case Mode::kNormal:
      return make_normal_mode();
    case Mode::kDepth:
      return make_depth_mode();
    case Mode::kDistance:
      return make_distance_mode();
    case Mode::kInstance:
      return make_instance_mode(inputs);
    case Mode::kMaterial:
      return make_material_mode();
    case Mode::kWireframe:
      return make_wireframe_mode(inputs);
    case Mode::kCost:
      return make_cost_mode();
  }
  throw InvalidArgument("render: unknown mode");
}

}  // namespace perfect_bvh
