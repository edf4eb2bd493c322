// The modes that show a number of each hit rather than light.
#include <algorithm>
#include <array>
#include <numbers>

#include "render/light/studio.h"
#include "render/modes/passes.h"
#include "render/modes/shading.h"
#include "render/sampling/sampler.h"
#include "render/surface/surface.h"

namespace perfect_bvh {
namespace {

// The distance of surfaces, in world units: along the view axis (depth) or along the ray (distance). All three channels
// have the number. If nothing was hit, it is the far value that Blender's depth pass also uses.
class DepthMode final : public ShadingMode {
 public:
  explicit DepthMode(bool along_ray) : along_ray_(along_ray) {}
  [[nodiscard]] bool is_exact() const noexcept override { return true; }
  void shade(const ShadeTask& task) const override {
    for (Rgba& color : task.colors) color = {kNoDepth, kNoDepth, kNoDepth, 0.0f};
    for (const SurfacePoint& point : task.points) {
      const float t = task.hits[point.ray].t;
      const float value = along_ray_ ? distance_of(task.rays[point.ray], t) : t;
      task.colors[point.ray] = {value, value, value, 1.0f};
    }
  }

 private:
  bool along_ray_;
};

// The shading normal in world space, turned towards the viewer, its -1..1 shown as 0..1.
class NormalMode final : public ShadingMode {
 public:
  [[nodiscard]] SurfaceNeeds needs() const noexcept override { return {.normals = true}; }
  void shade(const ShadeTask& task) const override {
    for (const SurfacePoint& point : task.points) {
      const Vec3f color = point.normal * 0.5f + Vec3f{0.5f, 0.5f, 0.5f};
      task.colors[point.ray] = {color.x, color.y, color.z, 1.0f};
    }
  }
};

// The position of each point in its mesh's uv map: u in red, v in green, and 1 in blue if there is a map, as in
// Blender's UV pass. These are numbers, not colours: they exceed 0..1 where the map does.
class UvMode final : public ShadingMode {
 public:
  explicit UvMode(const ModeInputs& inputs) : snapshot_(inputs.snapshot), appearance_(inputs.appearance) {}
  void shade(const ShadeTask& task) const override {
    for (const SurfacePoint& point : task.points) {
      const Hit& hit = task.hits[point.ray];
      const auto uv = uv_at(appearance_, snapshot_.instances[hit.instance_index], hit);
      task.colors[point.ray] = uv ? Rgba{uv->x, uv->y, 1.0f, 1.0f} : Rgba{0.0f, 0.0f, 0.0f, 1.0f};
    }
  }

 private:
  const Snapshot& snapshot_;
  const Appearance& appearance_;
};

// A colour for each instance, the same in every image and frame, because it only depends on the instance's id.
class InstanceMode final : public ShadingMode {
 public:
  explicit InstanceMode(const Snapshot& snapshot) : snapshot_(snapshot) {}
  void shade(const ShadeTask& task) const override {
    std::uint32_t known = kNoHit;
    Vec3f color{0, 0, 0};
    for (const SurfacePoint& point : task.points) {
      const std::uint32_t index = task.hits[point.ray].instance_index;
      if (index != known) {  // neighbours usually see the same one
        color = id_color(static_cast<std::uint32_t>(snapshot_.instances[index].id));
        known = index;
      }
      task.colors[point.ray] = {color.x, color.y, color.z, 1.0f};
    }
  }

 private:
  const Snapshot& snapshot_;
};

// A colour for each material, from its row in the material table; grey without a material.
class MaterialMode final : public ShadingMode {
 public:
  [[nodiscard]] SurfaceNeeds needs() const noexcept override { return {.materials = true}; }
  void shade(const ShadeTask& task) const override {
    constexpr Vec3f kNone{0.2f, 0.2f, 0.2f};
    std::int32_t known = kNoMaterial;
    Vec3f color = kNone;
    for (const SurfacePoint& point : task.points) {
      if (point.material != known) {  // neighbours usually show the same one
        known = point.material;
        color = known == kNoMaterial ? kNone : id_color(static_cast<std::uint32_t>(known));
      }
      task.colors[point.ray] = {color.x, color.y, color.z, 1.0f};
    }
  }
};

// The cost of each camera ray: nodes visited plus triangles tested, on a fixed scale, so that images of different
// scenes, trees and builders can be compared.
class CostMode final : public ShadingMode {
 public:
  [[nodiscard]] bool wants_counts() const noexcept override { return true; }
  void shade(const ShadeTask& task) const override {
    for (std::size_t i = 0; i < task.colors.size(); ++i) {  // a miss costs something too
      const RayCounts& counts = task.counts[i];
      const auto cost = static_cast<float>(counts.nodes_visited + counts.primitives_tested);
      const Vec3f color = cost_color(ramp_, cost);
      task.colors[i] = {color.x, color.y, color.z, 1.0f};
    }
  }

 private:
  ColorRamp ramp_;
};

}  // namespace

std::unique_ptr<ShadingMode> make_depth_mode() { return std::make_unique<DepthMode>(false); }
std::unique_ptr<ShadingMode> make_distance_mode() { return std::make_unique<DepthMode>(true); }
std::unique_ptr<ShadingMode> make_normal_mode() { return std::make_unique<NormalMode>(); }
std::unique_ptr<ShadingMode> make_uv_mode(const ModeInputs& inputs) { return std::make_unique<UvMode>(inputs); }
std::unique_ptr<ShadingMode> make_instance_mode(const ModeInputs& inputs) {
  return std::make_unique<InstanceMode>(inputs.snapshot);
}
std::unique_ptr<ShadingMode> make_material_mode() { return std::make_unique<MaterialMode>(); }
std::unique_ptr<ShadingMode> make_cost_mode() { return std::make_unique<CostMode>(); }

// Mode wireframe ------------------------------------------------------------------------------------------------------
// The edges of the tree's triangles, over softly lit surfaces without shadows. Lines have a constant width in pixels,
// and are smooth with a single sample: their coverage is computed from the change of the barycentric coordinates from
// pixel to pixel. If triangles are as small as pixels, the lines fade, so that the image is not a dark blot.

namespace {

// The change of a barycentric coordinate over one pixel to the right and one down.
struct Slope {
  double x, y;
  [[nodiscard]] double size() const noexcept { return std::sqrt(x * x + y * y); }
};

float smooth_step(double low, double high, double value) noexcept {
  const double part = std::clamp((value - low) / (high - low), 0.0, 1.0);
  return static_cast<float>(part * part * (3.0 - 2.0 * part));
}

class WireframeMode final : public ShadingMode {
 public:
  explicit WireframeMode(const ModeInputs& inputs)
      : snapshot_(inputs.snapshot),
        camera_(inputs.camera),
        settings_(inputs.settings.wireframe),
        color_(inputs.settings.clay.color),
        studio_(camera_) {}

  [[nodiscard]] SurfaceNeeds needs() const noexcept override { return {.normals = true, .materials = true}; }
  [[nodiscard]] bool has_backdrop() const noexcept override { return true; }
  [[nodiscard]] Vec3f backdrop(const Ray& /*ray*/, float x, float y) const override { return Studio::backdrop(x, y); }

  void shade(const ShadeTask& task) const override {
    for (const SurfacePoint& point : task.points) {
      const float key = studio_.key_cosine(point.light_normal);
      const Vec3f light = Studio::dome_mean(point.light_normal.z) + Studio::kKey * key;
      const float line = line_coverage(task.rays[point.ray], task.hits[point.ray]);
      const Vec3f color = color_.value_or(point.color) * light * (1.0f - line) + settings_.color * line;
      task.colors[point.ray] = {color.x, color.y, color.z, 1.0f};
    }
  }

 private:
  // Curves and points have no edges.
  [[nodiscard]] float line_coverage(const Ray& ray, const Hit& hit) const noexcept {
    if (snapshot_.instances[hit.instance_index].blas->mesh.is_round()) return 0.0f;
    const double u = static_cast<double>(hit.u), v = static_cast<double>(hit.v);
    const std::array<double, 3> coordinates{1.0 - u - v, u, v};
    const double width = static_cast<double>(settings_.width);
    float coverage = 0.0f;
    const auto slopes = slopes_at(ray, u, v, world_triangle(snapshot_, hit, ray.time));
    for (std::size_t i = 0; i < 3; ++i) {
      const double slope = slopes[i].size();  // one over the triangle's height above this edge, in pixels
      if (!(slope > 0.0) || !std::isfinite(slope)) continue;
      const double line = std::clamp(0.5 * width + 0.5 - coordinates[i] / slope, 0.0, 1.0);
      const float fade = 0.2f + 0.8f * smooth_step(1.5 * width, 9.0 * width, 1.0 / slope);
      coverage = std::max(coverage, static_cast<float>(line) * fade);
    }
    return coverage;
  }

  // Derivatives of Cramer's rule for origin + t direction = v0 + u e1 + v e2.
  [[nodiscard]] std::array<Slope, 3> slopes_at(const Ray& ray, double u, double v,
                                               const WorldTriangle& triangle) const noexcept {
    const Vec3d edge1 = triangle.v1 - triangle.v0, edge2 = triangle.v2 - triangle.v0;
    const Vec3d from = ray.origin - triangle.v0;
    const Vec3d across = cross(ray.direction, edge2);
    const double scale = 1.0 / dot(edge1, across);
    const auto change = [&](Vec3d step) -> std::array<double, 3> {
      double du = 0.0, dv = 0.0;
      if (camera_.orthographic()) {
        du = dot(step, across);
        dv = dot(ray.direction, cross(step, edge1));
      } else {
        const Vec3d turned = cross(step, edge2);
        const double stretch = dot(edge1, turned);
        du = dot(from, turned) - u * stretch;
        dv = dot(step, cross(from, edge1)) - v * stretch;
      }
      return {-(du + dv) * scale, du * scale, dv * scale};
    };
    const RayMaker::Steps steps = camera_.steps_at(ray);
    const auto right = change(steps.right), down = change(steps.down);
    return {Slope{right[0], down[0]}, Slope{right[1], down[1]}, Slope{right[2], down[2]}};
  }

  const Snapshot& snapshot_;
  const RayMaker& camera_;
  WireframeSettings settings_;
  std::optional<Vec3f> color_;  // of everything
  Studio studio_;
};

}  // namespace

std::unique_ptr<ShadingMode> make_wireframe_mode(const ModeInputs& inputs) {
  return std::make_unique<WireframeMode>(inputs);
}

// Palette -------------------------------------------------------------------------------------------------------------

namespace {

Vec3d linear_from_oklab(double lightness, double a, double b) noexcept {
  const auto cube = [](double x) { return x * x * x; };
  const double l = cube(lightness + 0.3963377774 * a + 0.2158037573 * b);
  const double m = cube(lightness - 0.1055613458 * a - 0.0638541728 * b);
  const double s = cube(lightness - 0.0894841775 * a - 1.2914855480 * b);
  return {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
          -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
          -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
}

bool on_screen(Vec3d color) noexcept {
  return std::min({color.x, color.y, color.z}) >= 0.0 && std::max({color.x, color.y, color.z}) <= 1.0;
}

}  // namespace

Vec3f color_from_lch(double lightness, double chroma, double hue) noexcept {
  const double angle = 2.0 * std::numbers::pi * hue;
  const auto [b, a] = sine_cosine(angle);
  double low = 0.0, high = chroma;
  if (!on_screen(linear_from_oklab(lightness, a * high, b * high))) {
    for (int i = 0; i < 12; ++i) {  // to 1/4096 of the chroma
      const double middle = 0.5 * (low + high);
      (on_screen(linear_from_oklab(lightness, a * middle, b * middle)) ? low : high) = middle;
    }
    high = low;
  }
  const Vec3f color = to_float(linear_from_oklab(lightness, a * high, b * high));
  return max(min(color, Vec3f{1, 1, 1}), Vec3f{0, 0, 0});
}

Vec3f id_color(std::uint32_t id) noexcept {
  // Golden-ratio steps separate the hues of consecutive ids; lightness distinguishes those that come close again.
  const std::uint32_t hue = id * 0x9e3779b9u;
  const std::uint32_t hash = sampling::mix(id + 1u);
  const double lightness = 0.58 + 0.26 * static_cast<double>(hash >> 16) * 0x1p-16;
  const double chroma = 0.10 + 0.07 * static_cast<double>(hash & 0xffffu) * 0x1p-16;
  return color_from_lch(lightness, chroma, static_cast<double>(hue) * 0x1p-32);
}

ColorRamp::ColorRamp() {
  for (int i = 0; i <= kCells; ++i) {
    const double amount = static_cast<double>(i) / kCells;
    const double lightness = 0.16 + 0.80 * amount;
    const double hue = 0.80 + 0.50 * amount;  // violet, magenta, red, orange, yellow
    const double chroma = 0.10 + 0.12 * sine(std::numbers::pi * amount);
    colors_[static_cast<std::size_t>(i)] = color_from_lch(lightness, chroma, hue);
  }
}

Vec3f ColorRamp::at(float amount) const noexcept {
  if (!(amount > 0.0f)) return colors_.front();
  if (amount >= 1.0f) return colors_.back();
  const float place = amount * static_cast<float>(kCells);
  const auto cell = static_cast<std::size_t>(place);
  const float part = place - static_cast<float>(cell);
  return colors_[cell] * (1.0f - part) + colors_[cell + 1] * part;
}

}  // namespace perfect_bvh
