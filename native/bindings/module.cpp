#include <pybind11/stl.h>

#include <memory>
#include <string>
#include <vector>

#include "bindings/bind.h"
#include "core/errors.h"
#include "core/thread_pool.h"
#include "traverse/dispatch.h"

namespace perfect_bvh::bindings {

namespace py = pybind11;

// The exception classes are written in Python, where they are documented; the translator looks them up there.
void bind_errors(py::module_&) {
  py::register_local_exception_translator([](std::exception_ptr thrown) {
    const auto raise = [](const char* name, const char* what) {
      const py::object type = py::module_::import("perfect_bvh.errors").attr(name);
      PyErr_SetString(type.ptr(), what);
    };
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const InvalidArgument& error) {
      PyErr_SetString(PyExc_ValueError, error.what());
    } catch (const StaleScene& error) {
      raise("StaleSceneError", error.what());
    } catch (const Cancelled& error) {
      raise("Cancelled", error.what());
    } catch (const EngineError& error) {
      raise("EngineError", error.what());
    }
  });
}

// Isa -----------------------------------------------------------------------------------------------------------------

namespace py = pybind11;

void bind_isa(py::module_& module) {
  module.def("available_isas", [] {
    std::vector<std::string> names;
    for (const KernelTable* table : available_kernels()) names.emplace_back(table->name);
    return names;
  });
  module.def("active_isa", [] { return std::string(active_kernels().name); });
  module.def("set_active_isa", [](const std::string& name) { set_active_kernels(name); }, py::arg("name"));
}

// Threads -------------------------------------------------------------------------------------------------------------

namespace py = pybind11;

void bind_threads(py::module_& module) {
  constexpr int kMostThreads = 1024;
  module.def(
      "thread_count", [] { return ThreadPool::shared().thread_count(); },
      "Returns how many threads long calls use, including the calling thread.");
  module.def(
      "set_thread_count",
      [](int count) {
        if (count < 0 || count > kMostThreads) {
          throw InvalidArgument("set_thread_count: count must be 0 (as many as the process may use) to " +
                                std::to_string(kMostThreads) + ", got " + std::to_string(count));
        }
        const py::gil_scoped_release release;
        ThreadPool::set_shared_thread_count(count);
      },
      py::arg("count"),
      "Sets how many threads long calls use from now on. 0, the default, means as many as the process may use.\n\n"
      "Results do not change. Running calls finish first. Raises ValueError for less than 0 or more than 1024.");
  module.def(
      "shutdown_threads",
      [] {
        const py::gil_scoped_release release;
        ThreadPool::shutdown_shared();
      },
      "Ends the engine's threads; the next long call starts them again.");
  py::class_<StopFlag, std::shared_ptr<StopFlag>> stop_flag(
      module, "StopFlag",
      "Stops long calls from another thread, which pass it as their `progress`.\n\n"
      "Other `progress` callables run about 20 times a second and need Python's lock. Each thread of a call reads the\n"
      "flag after about every millisecond of work, without the lock. The calls then raise `Cancelled`. A flag that is\n"
      "set stays set. `make_stop_flag` makes them.");
  stop_flag
      .def(
          "set", [](StopFlag& flag) { flag.is_set.store(true, std::memory_order_relaxed); },
          "Stops all calls that have this flag as their `progress`, now and later. Any thread may call it.")
      .def_property_readonly("is_set", [](const StopFlag& flag) { return flag.is_set.load(std::memory_order_relaxed); })
      .def(
          "__call__", [](const StopFlag& flag, double) { return !flag.is_set.load(std::memory_order_relaxed); },
          py::arg("share"), "Returns whether to continue, as any `progress` does.");
  make_only_natively(stop_flag);
  module.def(
      "make_stop_flag", [] { return std::make_shared<StopFlag>(); }, "Returns a new `StopFlag`, which is not set.");
}

}  // namespace perfect_bvh::bindings

// Module --------------------------------------------------------------------------------------------------------------
// The compiled module `_core`. Only the Python layer imports it.

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
  bind_queries(module);  // before the scene, whose signatures use its Snapshot
  bind_curve_chains(module);
  bind_scene(module);
  bind_render(module);
  bind_nodes(module);
  bind_filter(module);
  bind_statistics(module);
  bind_bulk(module);
}
