// Curves and points of a scene.
#pragma once

#include <pybind11/pybind11.h>

#include "scene/scene.h"

namespace perfect_bvh::bindings {

void bind_round_edits(pybind11::class_<Scene>& scene);

}  // namespace perfect_bvh::bindings
