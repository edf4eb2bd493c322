// The scene as it will look: its materials under its own lights and world, by path tracing (light/path_tracer.h).
#include <algorithm>
#include <optional>

#include "render/light/path_tracer.h"
#include "render/light/studio.h"
#include "render/modes/shading.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {
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

  // Shadow catchers show the light that they get beside that which they get by the same rays where nothing but catchers
  // is: what no shadow reaches is without noise. The mean of these quotients is shown, which can be added to later;
  // Cycles has the quotient of the means. It differs where light that bounces is more than what shadows take.
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
  Appearance catchers_;  // the same, where rays for light meet shadow catchers alone
  std::optional<PathTracer> open_;
};

}  // namespace

std::unique_ptr<ShadingMode> make_preview_mode(const ModeInputs& inputs) {
  return std::make_unique<PreviewMode>(inputs);
}

}  // namespace perfect_bvh
