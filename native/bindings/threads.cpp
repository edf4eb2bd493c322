#include "bindings/bind.h"
#include "core/thread_pool.h"

namespace perfect_bvh::bindings {

namespace py = pybind11;

void bind_threads(py::module_& module) {
  module.def("thread_count", [] { return ThreadPool::shared().thread_count(); });
  module.def(
      "set_thread_count",
      [](int count) {
        const py::gil_scoped_release release;
        ThreadPool::set_shared_thread_count(count);
      },
      py::arg("count"));
  module.def("shutdown_threads", [] {
    const py::gil_scoped_release release;
    ThreadPool::shutdown_shared();
  });
}

}  // namespace perfect_bvh::bindings
