// The compiled module `_core`. Only the Python face imports it.
#include "bindings/bind.h"

PYBIND11_MODULE(_core, module) {
  using namespace perfect_bvh::bindings;
  module.doc() = "Native engine of Perfect BVH; use the package perfect_bvh instead.";
  module.attr("__version__") = PERFECT_BVH_VERSION;
  bind_errors(module);
  bind_threads(module);
  bind_isa(module);
  bind_queries(module);  // before the scene, whose signatures name its Snapshot
  bind_scene(module);
  bind_render(module);
  bind_statistics(module);
  bind_bulk(module);
}
