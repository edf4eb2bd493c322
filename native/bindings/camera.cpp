#include "bindings/camera.h"

#include <map>
#include <tuple>

#include "bindings/values.h"

namespace perfect_bvh::bindings {
namespace {

const std::map<std::string, Projection> kProjections{{"perspective", Projection::kPerspective},
                                                     {"orthographic", Projection::kOrthographic},
                                                     {"equirectangular", Projection::kEquirectangular}};

}  // namespace

Camera read_camera(const py::dict& values) {
  Camera camera;
  const auto matrix = get<Array<double>>(values, "matrix");
  const double* m = matrix.data();
  camera.camera_to_world = {{m[0], m[4], m[8]}, {m[1], m[5], m[9]}, {m[2], m[6], m[10]}, {m[3], m[7], m[11]}};
  using Four = std::tuple<double, double, double, double>;
  std::tie(camera.left, camera.right, camera.bottom, camera.top) = get<Four>(values, "window");
  camera.projection = kProjections.at(get<std::string>(values, "projection"));
  camera.clip_start = get<float>(values, "clip_start");
  camera.clip_end = get<float>(values, "clip_end");
  using FourFloats = std::tuple<float, float, float, float>;
  std::tie(camera.border_left, camera.border_right, camera.border_bottom, camera.border_top) =
      get<FourFloats>(values, "border");
  if (!values["lens"].is_none()) {
    const auto lens = values["lens"].cast<py::dict>();
    camera.lens = Lens{get<double>(lens, "radius"), get<double>(lens, "focus_distance"), get<int>(lens, "blades"),
                       get<double>(lens, "rotation"), get<double>(lens, "ratio")};
  }
  return camera;
}

Shutter read_shutter(const py::dict& values) {
  Shutter shutter;
  const auto times = get<Array<float>>(values, "times");
  shutter.times.assign(times.data(), times.data() + times.size());
  if (!values["rolling"].is_none()) shutter.rolling = get<float>(values, "rolling");
  shutter.blurs = get<bool>(values, "blurs");
  shutter.frame_time = get<float>(values, "frame_time");
  for (const py::handle camera : values["cameras"]) shutter.cameras.push_back(read_camera(camera.cast<py::dict>()));
  return shutter;
}

}  // namespace perfect_bvh::bindings
