// The modes that show a number of each hit rather than light.
#include "render/modes/palette.h"
#include "render/modes/passes.h"
#include "render/modes/shading.h"
#include "render/surface/material.h"

namespace perfect_bvh {
namespace {

// How far away surfaces are, in world units: along the view axis (depth) or along the ray (distance). The number
// stands in all three colours; where nothing was hit it is the far value that Blender's depth pass uses too.
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

// Where in its mesh's uv map each point lies: u in red, v in green, and 1 in blue where there is a map, as in Blender's
// own UV pass. Numbers, not colours: they leave 0..1 where the map does.
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

// A colour for each instance, the same in every image and on every frame: it follows from the instance's id alone.
class InstanceMode final : public ShadingMode {
 public:
  explicit InstanceMode(const Snapshot& snapshot) : snapshot_(snapshot) {}
  void shade(const ShadeTask& task) const override {
    std::uint32_t known = kNoHit;
    Vec3f color{0, 0, 0};
    for (const SurfacePoint& point : task.points) {
      const std::uint32_t index = task.hits[point.ray].instance_index;
      if (index != known) {  // neighbours mostly see the same one
        color = id_color(static_cast<std::uint32_t>(snapshot_.instances[index].id));
        known = index;
      }
      task.colors[point.ray] = {color.x, color.y, color.z, 1.0f};
    }
  }

 private:
  const Snapshot& snapshot_;
};

// A colour for each material, from its row in the material table; grey where there is none.
class MaterialMode final : public ShadingMode {
 public:
  [[nodiscard]] SurfaceNeeds needs() const noexcept override { return {.materials = true}; }
  void shade(const ShadeTask& task) const override {
    constexpr Vec3f kNone{0.2f, 0.2f, 0.2f};
    std::int32_t known = kNoMaterial;
    Vec3f color = kNone;
    for (const SurfacePoint& point : task.points) {
      if (point.material != known) {  // neighbours mostly show the same one
        known = point.material;
        color = known == kNoMaterial ? kNone : id_color(static_cast<std::uint32_t>(known));
      }
      task.colors[point.ray] = {color.x, color.y, color.z, 1.0f};
    }
  }
};

// What each camera ray cost: nodes visited plus triangles tested, on one fixed scale, so that images of different
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

}  // namespace perfect_bvh
