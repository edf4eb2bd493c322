// The shading normal in world space, turned towards the viewer, its -1..1 shown as 0..1.
#include "render/modes/shading.h"

namespace perfect_bvh {
namespace {

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

}  // namespace

std::unique_ptr<ShadingMode> make_normal_mode() { return std::make_unique<NormalMode>(); }

}  // namespace perfect_bvh
