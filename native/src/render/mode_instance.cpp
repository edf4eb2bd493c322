// A colour for each instance, the same in every image and on every frame: it follows from the instance's id alone.
#include "render/palette.h"
#include "render/shading.h"

namespace perfect_bvh {
namespace {

class InstanceMode final : public ShadingMode {
 public:
  explicit InstanceMode(const Snapshot& snapshot) : snapshot_(snapshot) {}
  void shade(const ShadeTask& task) const override {
    for (const SurfacePoint& point : task.points) {
      const Instance& instance = snapshot_.instances[task.hits[point.ray].instance_index];
      const Vec3f color = id_color(static_cast<std::uint32_t>(instance.id));
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
