// The compiled module `_core`. Only the Python face imports it.
#include "bindings/bind.h"

namespace perfect_bvh::bindings {
namespace {

PyObject* refuse_to_make(PyTypeObject* type, PyObject*, PyObject*) {
  PyErr_Format(PyExc_TypeError, "%s: only the engine makes these; use the package perfect_bvh", type->tp_name);
  return nullptr;
}

}  // namespace

void make_only_natively(const pybind11::handle& native_class) {
  reinterpret_cast<PyTypeObject*>(native_class.ptr())->tp_new = refuse_to_make;
}

}  // namespace perfect_bvh::bindings

PYBIND11_MODULE(_core, module) {
  using namespace perfect_bvh::bindings;
  module.doc() = "Native engine of Perfect BVH; use the package perfect_bvh instead.";
  module.attr("__version__") = PERFECT_BVH_VERSION;
  bind_errors(module);
  bind_threads(module);
  bind_isa(module);
  bind_queries(module);  // before the scene, whose signatures name its Snapshot
  bind_curve_chains(module);
  bind_scene(module);
  bind_render(module);
  bind_filter(module);
  bind_statistics(module);
  bind_bulk(module);
}
