// Where in its mesh's uv map each point lies: u in red, v in green, and 1 in blue where there is a map, as in Blender's
// own UV pass. Numbers, not colours: they leave 0..1 where the map does.
#include "render/modes/shading.h"
#include "render/surface/material.h"

namespace perfect_bvh {
namespace {

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

}  // namespace

std::unique_ptr<ShadingMode> make_uv_mode(const ModeInputs& inputs) { return std::make_unique<UvMode>(inputs); }

}  // namespace perfect_bvh
