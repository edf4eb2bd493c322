// How long native calls hear of Ctrl-C, of a Python `progress` callable, and of a flag that another thread sets.
#pragma once

#include <pybind11/pybind11.h>

#include <atomic>

#include "core/cancel.h"

namespace perfect_bvh::bindings {

namespace py = pybind11;

// Given as `progress`, it stops a call as soon as it is set: every thread of the call looks at it, none needs the GIL.
struct StopFlag {
  std::atomic<bool> is_set{false};
};

// A token whose callback takes the GIL, looks for signals (which may raise KeyboardInterrupt) and asks
// progress(fraction), if it is not None, whether to go on: anything but an explicit False goes on.
// The token may be used with the GIL released; `progress` must outlive it.
[[nodiscard]] inline CancelToken::Callback make_progress(const py::object& progress) {
  return [&progress](float fraction) {
    const py::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (progress.is_none()) return true;
    const py::object answer = progress(fraction);
    return !answer.is(py::bool_(false));
  };
}

// Runs work(cancel) with the GIL released. What the callback raised reaches the caller as it is.
template <class Work>
auto with_progress(const py::object& progress, Work&& work) {
  const StopFlag* flag = py::isinstance<StopFlag>(progress) ? progress.cast<const StopFlag*>() : nullptr;
  const py::gil_scoped_release release;
  CancelToken cancel(make_progress(progress));
  if (flag != nullptr) cancel.follow(flag->is_set);
  try {
    return work(cancel);
  } catch (const Cancelled&) {
    cancel.rethrow_callback_error();
    throw;
  }
}

}  // namespace perfect_bvh::bindings
