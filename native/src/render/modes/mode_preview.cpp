// The scene as it will look, roughly: its materials' base colours, specular reflection, emission and transparency under
// its own lights and world, with one bounce of light (see illumination.h). Glass is seen through straight.
#include <algorithm>
#include <optional>

#include "render/light/studio.h"
#include "render/modes/shading.h"
#include "render/sampling/sampler.h"
#include "render/surface/material.h"

namespace perfect_bvh {
namespace {

constexpr int kMostLayers = 16;              // of transparent surfaces, one behind another
constexpr float kLeastThrough = 1 / 256.0f;  // less than that cannot be seen

class PreviewMode final : public ShadingMode {
 public:
  explicit PreviewMode(const ModeInputs& inputs)
      : snapshot_(inputs.snapshot),
        cancel_(inputs.cancel),
        appearance_(inputs.appearance),
        illumination_(inputs.snapshot, inputs.appearance, inputs.settings.seed, inputs.settings.preview.light_rays,
                      inputs.settings.threads, inputs.cancel) {
    if (appearance_.catcher_mask == 0) return;
    if (std::none_of(snapshot_.instances.begin(), snapshot_.instances.end(),
                     [&](const Instance& instance) { return appearance_.is_catcher(instance); })) {
      return;
    }
    catchers_ = appearance_;
    catchers_.shadow_mask = catchers_.diffuse_mask = catchers_.glossy_mask = appearance_.catcher_mask;
    open_.emplace(inputs.snapshot, catchers_, inputs.settings.seed, inputs.settings.preview.light_rays,
                  inputs.settings.threads, inputs.cancel);
  }

  [[nodiscard]] SurfaceNeeds needs() const noexcept override {
    return {.normals = true, .origins = true, .materials = true};
  }
  [[nodiscard]] bool has_focus() const noexcept override { return true; }
  [[nodiscard]] bool has_backdrop() const noexcept override { return true; }
  [[nodiscard]] bool keeps_light_apart() const noexcept override { return true; }
  [[nodiscard]] Vec3f backdrop(const Ray& ray, float x, float y) const override {
    if (!appearance_.world) return Studio::backdrop(x, y);
    return illumination_.environment().backdrop(to_float(normalized(ray.direction)));
  }

  void shade(const ShadeTask& task) const override {
    ShadeScratch& scratch = task.scratch;
    SurfaceLayer& layer = scratch.layer;
    layer.owners.clear(), layer.weights.clear();
    for (const SurfacePoint& point : task.points) layer.owners.push_back(point.ray), layer.weights.push_back(1.0f);
    const Seen first{task.points, task.rays, task.hits};
    shade_layer(task, first, layer);
    scratch.lit_points.assign(task.points.size(), LitPoint{});
    for (std::size_t row = 0; row < task.points.size(); ++row) {
      const Material& material = layer.materials[row];
      LitPoint& lit_point = scratch.lit_points[row];
      lit_point.light.sky = layer.light[row];
      lit_point.color = material.color * material.alpha;
      lit_point.lit = lit_point.color * layer.light[row];
      lit_point.known = layer.speculars.empty() || layer.speculars[row].over_diffuse;
    }
    if (open_) {
      for (const std::uint32_t row : scratch.caught.rows) scratch.lit_points[row].known = false;
    }
    if (appearance_.any_transparent()) shade_behind(task, first, layer);
  }

  void relight(std::span<const LightPixel> pixels, std::span<Rgba> colors) const override {
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const LightPixel& pixel = pixels[i];
      if (!pixel.on_surface()) continue;
      const Vec3f color = pixel.color * pixel.light.sky * pixel.share;
      colors[i] = {colors[i].r + color.x, colors[i].g + color.y, colors[i].b + color.z, colors[i].a};
    }
  }

 private:
  struct Seen {
    std::span<const SurfacePoint> points;
    std::span<const Ray> rays;
    std::span<const Hit> hits;
  };

  static void add(Rgba& to, Vec3f color, float alpha) noexcept {
    to = {to.r + color.x, to.g + color.y, to.b + color.z, to.a + alpha};
  }

  // Finds the materials and the light of a layer's points, and adds what they show to the colours of their owners.
  void shade_layer(const ShadeTask& task, const Seen& seen, SurfaceLayer& layer) const {
    layer.places.clear(), layer.materials.clear();
    for (std::size_t row = 0; row < seen.points.size(); ++row) {
      const SurfacePoint& point = seen.points[row];
      const Hit& hit = seen.hits[point.ray];
      const Pixel pixel = task.pixels[layer.owners[row]];
      layer.places.push_back(sampling::z_order(pixel.x, pixel.y));
      layer.materials.push_back(material_at(appearance_, snapshot_.instances[hit.instance_index], hit, point.material));
    }
    find_speculars(seen, layer);
    layer.light.resize(seen.points.size()), layer.shine.resize(layer.speculars.size());
    illumination_.gather({seen.points, layer.places, layer.speculars, layer.light, layer.shine}, task.sample,
                         task.scratch.illumination);
    if (open_) catch_shadows(task, seen, layer);
    for (std::size_t row = 0; row < seen.points.size(); ++row) {
      const Material& material = layer.materials[row];
      Vec3f color = material.emission + material.color * layer.light[row];
      if (!layer.shine.empty()) color = color + layer.shine[row];
      const float weight = layer.weights[row];
      add(task.colors[layer.owners[row]], color * (weight * material.alpha), weight * material.shown());
    }
  }

  // Shows the points on shadow catchers, and leaves nothing of them for others to show. The light that they get is held
  // against that which they get by the same rays where nothing but catchers is: what no shadow reaches is without
  // noise. The mean of these quotients is shown, Cycles has the quotient of the means.
  void catch_shadows(const ShadeTask& task, const Seen& seen, SurfaceLayer& layer) const {
    CaughtLight& caught = task.scratch.caught;
    caught.rows.clear(), caught.points.clear(), caught.places.clear();
    for (std::uint32_t row = 0; row < seen.points.size(); ++row) {
      const SurfacePoint& point = seen.points[row];
      if (!appearance_.is_catcher(snapshot_.instances[seen.hits[point.ray].instance_index])) continue;
      caught.rows.push_back(row), caught.points.push_back(point), caught.places.push_back(layer.places[row]);
    }
    if (caught.rows.empty()) return;
    caught.light.resize(caught.rows.size()), caught.open.resize(caught.rows.size());
    illumination_.gather({caught.points, caught.places, {}, caught.light, {}}, task.sample, task.scratch.illumination);
    open_->gather({caught.points, caught.places, {}, caught.open, {}}, task.sample, task.scratch.illumination);
    for (std::size_t i = 0; i < caught.rows.size(); ++i) {
      const std::uint32_t row = caught.rows[i];
      const float bright = share_left(caught.light[i], caught.open[i]), weight = layer.weights[row];
      Rgba& color = task.colors[layer.owners[row]];
      if (appearance_.film_transparent) {
        add(color, {0, 0, 0}, weight * (1.0f - bright));
      } else {
        const Vec3f direction = to_float(normalized(seen.rays[caught.points[i].ray].direction));
        add(color, illumination_.environment().backdrop(direction) * (weight * bright), weight);
      }
      layer.materials[row] = Material{.holdout = 1.0f};
      layer.light[row] = {0, 0, 0};
      if (!layer.shine.empty()) layer.shine[row] = {0, 0, 0};
    }
  }

  // The mean over the channels.
  [[nodiscard]] static float share_left(Vec3f light, Vec3f open) noexcept {
    const auto share = [](float some, float all) { return all > 0.0f ? std::min(some / all, 1.0f) : 1.0f; };
    return (share(light.x, open.x) + share(light.y, open.y) + share(light.z, open.z)) / 3.0f;
  }

  // What is mirrored is neither given back diffuse nor let through.
  void find_speculars(const Seen& seen, SurfaceLayer& layer) const {
    layer.speculars.clear();
    if (!appearance_.any_glossy()) return;
    for (std::size_t row = 0; row < seen.points.size(); ++row) {
      const SurfacePoint& point = seen.points[row];
      Material& material = layer.materials[row];
      const Vec3f view = to_float(-normalized(seen.rays[point.ray].direction));
      Specular& specular = layer.speculars.emplace_back(Specular{material.reflectance, material.roughness, view});
      specular.over_diffuse = !is_black(material.color);
      if (!specular.mirrors()) continue;
      const float rest = unreflected_share(specular, dot(point.light_normal, view));
      material.color = material.color * rest, material.transmission *= rest;
    }
  }

  // What is seen through the first layer, layer by layer.
  void shade_behind(const ShadeTask& task, const Seen& first, SurfaceLayer& layer) const {
    Seen seen = first;
    SurfaceLayer& next = task.scratch.next_layer;
    for (int depth = 1; depth < kMostLayers; ++depth) {
      go_on(seen, layer, next);
      if (next.rays.empty()) return;
      next.hits.resize(next.rays.size());
      trace_closest(snapshot_, cancel_, next.rays, next.hits);
      add_backdrop(task, next);
      next.points.clear();
      find_surfaces(snapshot_, appearance_, needs(), next.rays, next.hits, next.points);
      // From one row a ray to one a point.
      for (std::size_t row = 0; row < next.points.size(); ++row) {
        next.owners[row] = next.owners[next.points[row].ray], next.weights[row] = next.weights[next.points[row].ray];
      }
      std::swap(layer, next);
      seen = {layer.points, layer.rays, layer.hits};
      shade_layer(task, seen, layer);
    }
  }

  // The rays that pass a layer, from behind it on.
  static void go_on(const Seen& seen, const SurfaceLayer& layer, SurfaceLayer& next) {
    next.rays.clear(), next.owners.clear(), next.weights.clear();
    for (std::size_t row = 0; row < seen.points.size(); ++row) {
      const float weight = layer.weights[row] * layer.materials[row].through();
      if (!(weight > kLeastThrough)) continue;
      Ray ray = seen.rays[seen.points[row].ray];
      ray.t_min = std::nextafter(seen.hits[seen.points[row].ray].t, kInfiniteDistance);
      next.rays.push_back(ray), next.owners.push_back(layer.owners[row]), next.weights.push_back(weight);
    }
  }

  void add_backdrop(const ShadeTask& task, const SurfaceLayer& layer) const {
    if (appearance_.film_transparent) return;
    for (std::size_t row = 0; row < layer.rays.size(); ++row) {
      if (layer.hits[row].found()) continue;
      const Vec3f color = illumination_.environment().backdrop(to_float(normalized(layer.rays[row].direction)));
      add(task.colors[layer.owners[row]], color * layer.weights[row], layer.weights[row]);
    }
  }

  const Snapshot& snapshot_;
  CancelToken& cancel_;
  const Appearance& appearance_;
  Illumination illumination_;
  Appearance catchers_;  // the same, where rays for light meet shadow catchers alone
  std::optional<Illumination> open_;
};

}  // namespace

std::unique_ptr<ShadingMode> make_preview_mode(const ModeInputs& inputs) {
  return std::make_unique<PreviewMode>(inputs);
}

}  // namespace perfect_bvh
