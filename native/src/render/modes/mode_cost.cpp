// What each camera ray cost: nodes visited plus triangles tested, on one fixed scale, so that images of different
// scenes, trees and builders can be compared.
#include "render/modes/cost_scale.h"
#include "render/modes/shading.h"

namespace perfect_bvh {
namespace {

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

std::unique_ptr<ShadingMode> make_cost_mode() { return std::make_unique<CostMode>(); }

}  // namespace perfect_bvh
