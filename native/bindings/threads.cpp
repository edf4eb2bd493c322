#include <string>

#include "bindings/bind.h"
#include "core/errors.h"
#include "core/thread_pool.h"

namespace perfect_bvh::bindings {

namespace py = pybind11;

void bind_threads(py::module_& module) {
  constexpr int kMostThreads = 1024;
  module.def(
      "thread_count", [] { return ThreadPool::shared().thread_count(); },
      "How many threads long calls use, the calling one included.");
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
      "Sets how many threads long calls use from now on; 0, the default, for as many as the process may use.\n\n"
      "Changes no answer. Calls under way are finished. Raises ValueError for less than 0 or more than 1024.");
  module.def(
      "shutdown_threads",
      [] {
        const py::gil_scoped_release release;
        ThreadPool::shutdown_shared();
      },
      "Ends the engine's threads; the next long call starts them again.");
}

}  // namespace perfect_bvh::bindings
