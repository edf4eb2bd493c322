// Cameras and shutters from what the Python face has checked.
#pragma once

#include "bindings/arrays.h"
#include "render/sampling/shutter.h"

namespace perfect_bvh::bindings {

[[nodiscard]] Camera read_camera(const py::dict& values);
[[nodiscard]] Shutter read_shutter(const py::dict& values);

}  // namespace perfect_bvh::bindings
