#include "core/errors.h"

#include "bindings/bind.h"

namespace perfect_bvh::bindings {

namespace py = pybind11;

// The exception classes live in Python, where their documentation is read; translation looks them up there.
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

}  // namespace perfect_bvh::bindings
