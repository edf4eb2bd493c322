// A colour for each material, from its row in the material table; grey where there is none.
#include "render/modes/palette.h"
#include "render/modes/shading.h"

namespace perfect_bvh {
namespace {

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

}  // namespace

std::unique_ptr<ShadingMode> make_material_mode() { return std::make_unique<MaterialMode>(); }

}  // namespace perfect_bvh
