// What each camera ray cost: nodes visited plus triangles tested, on one fixed scale, so that images of different
// scenes, trees and builders can be compared: logarithmic, eight doublings from 2 (violet) to 512 (pale yellow).
#include "render/modes/palette.h"
#include "render/modes/shading.h"

namespace perfect_bvh {
namespace {

constexpr float kLeast = 2.0f;
constexpr float kDoublings = 8.0f;

class CostMode final : public ShadingMode {
 public:
  [[nodiscard]] bool wants_counts() const noexcept override { return true; }
  void shade(const ShadeTask& task) const override {
    for (std::size_t i = 0; i < task.colors.size(); ++i) {  // a miss costs something too
      const RayCounts& counts = task.counts[i];
      const auto cost = static_cast<float>(counts.nodes_visited + counts.primitives_tested);
      const Vec3f color = ramp_.at(std::log2(std::max(cost, 1.0f) / kLeast) / kDoublings);
      task.colors[i] = {color.x, color.y, color.z, 1.0f};
    }
  }

 private:
  ColorRamp ramp_;
};

}  // namespace

std::unique_ptr<ShadingMode> make_cost_mode() { return std::make_unique<CostMode>(); }

}  // namespace perfect_bvh
