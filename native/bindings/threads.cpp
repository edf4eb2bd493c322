#include <memory>
#include <string>

#include "bindings/bind.h"
#include "bindings/progress.h"
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
  py::class_<StopFlag, std::shared_ptr<StopFlag>> stop_flag(
      module, "StopFlag",
      "Ends long calls from another thread: given as their `progress`, which is otherwise asked about every twentieth\n"
      "of a second and needs Python's lock for it, it is looked at by each thread of a call after every millisecond\n"
      "or so of work. They then raise `Cancelled`. One that is set stays so. `make_stop_flag` makes them.");
  stop_flag
      .def(
          "set", [](StopFlag& flag) { flag.is_set.store(true, std::memory_order_relaxed); },
          "Ends the calls that were given it, and any that will be; from any thread.")
      .def_property_readonly("is_set", [](const StopFlag& flag) { return flag.is_set.load(std::memory_order_relaxed); })
      .def(
          "__call__", [](const StopFlag& flag, double) { return !flag.is_set.load(std::memory_order_relaxed); },
          py::arg("share"), "Whether to go on: what any `progress` is asked.");
  make_only_natively(stop_flag);
  module.def("make_stop_flag", [] { return std::make_shared<StopFlag>(); }, "A `StopFlag` that is not set.");
}

}  // namespace perfect_bvh::bindings
