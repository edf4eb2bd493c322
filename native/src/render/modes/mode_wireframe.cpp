// The edges of the triangles that the tree holds, over softly lit surfaces without shadows. Lines keep their width in
// pixels and are smooth with a single sample: their coverage follows from how fast the barycentric coordinates change
// from pixel to pixel. Where triangles get as small as pixels the lines fade, or all would be one dark blot.
#include <array>

#include "render/light/studio.h"
#include "render/modes/shading.h"

namespace perfect_bvh {
namespace {

// How fast a barycentric coordinate changes over one pixel to the right and one down.
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

}  // namespace perfect_bvh
