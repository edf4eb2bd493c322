// The compiled module `_core`. Only the Python facade imports it.
#include <pybind11/pybind11.h>

PYBIND11_MODULE(_core, module) {
  module.doc() = "Native engine of Perfect BVH; use the package perfect_bvh instead.";
  module.attr("__version__") = PERFECT_BVH_VERSION;
}
