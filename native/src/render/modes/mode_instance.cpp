// A colour for each instance, the same in every image and on every frame: it follows from the instance's id alone.
#include "render/modes/palette.h"
#include "render/modes/shading.h"

namespace perfect_bvh {
namespace {

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

}  // namespace

std::unique_ptr<ShadingMode> make_instance_mode(const ModeInputs& inputs) {
  return std::make_unique<InstanceMode>(inputs.snapshot);
}

}  // namespace perfect_bvh
