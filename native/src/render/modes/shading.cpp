#include "render/modes/shading.h"

#include "core/errors.h"

namespace perfect_bvh {

std::unique_ptr<ShadingMode> make_mode(const ModeInputs& inputs) {
  switch (inputs.settings.mode) {
    case Mode::kPreview:
      return make_preview_mode(inputs);
    case Mode::kClay:
      return make_clay_mode(inputs);
    case Mode::kMatcap:
      return make_matcap_mode(inputs);
    case Mode::kUv:
      return make_uv_mode(inputs);
    case Mode::kNormal:
      return make_normal_mode();
    case Mode::kDepth:
      return make_depth_mode();
    case Mode::kDistance:
      return make_distance_mode();
    case Mode::kInstance:
      return make_instance_mode(inputs);
    case Mode::kMaterial:
      return make_material_mode();
    case Mode::kWireframe:
      return make_wireframe_mode(inputs);
    case Mode::kCost:
      return make_cost_mode();
  }
  throw InvalidArgument("render: mode is none of the engine's");
}

}  // namespace perfect_bvh
