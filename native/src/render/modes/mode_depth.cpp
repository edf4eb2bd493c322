// How far away surfaces are, in world units: along the view axis (depth) or along the ray (distance). The number
// stands in all three colours; where nothing was hit it is the far value that Blender's depth pass uses too.
#include "render/modes/passes.h"
#include "render/modes/shading.h"

namespace perfect_bvh {
namespace {

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

}  // namespace

std::unique_ptr<ShadingMode> make_depth_mode() { return std::make_unique<DepthMode>(false); }
std::unique_ptr<ShadingMode> make_distance_mode() { return std::make_unique<DepthMode>(true); }

}  // namespace perfect_bvh
