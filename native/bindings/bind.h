// numpy arrays as spans. `_core` takes only C-contiguous arrays of the exact dtype: by default pybind11 would copy
// others without notice. The Python layer converts them, where the conversion is visible in its code.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "blas/build_tree.h"
#include "builders/builder.h"
#include "core/cancel.h"
#include "core/errors.h"
#include "math/turning.h"
#include "math/vec3.h"
#include "render/appearance/appearance.h"
#include "render/sampling/camera.h"
#include "scene/scene.h"

namespace perfect_bvh::bindings {

namespace py = pybind11;

template <class T>
using Array = py::array_t<T, py::array::c_style>;

// Views an array of shape (rows, 3) as vectors.
template <class T>
std::span<const Vec3<T>> as_vectors(const Array<T>& array) {
  if (array.ndim() != 2 || array.shape(1) != 3)
    throw std::invalid_argument("_core: expected an array of shape (rows, 3)");
  return {reinterpret_cast<const Vec3<T>*>(array.data()), static_cast<std::size_t>(array.shape(0))};
}

template <class T>
std::span<const T> as_span(const Array<T>& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

// Copies values into a new array.
template <class T>
Array<T> to_column(const std::vector<T>& values) {
  return Array<T>(static_cast<py::ssize_t>(values.size()), values.data());
}

// Values --------------------------------------------------------------------------------------------------------------
// Dictionaries from the Python layer as values and spans.

template <class T>
[[nodiscard]] T get(const py::dict& values, const char* name) {
  return values[name].cast<T>();
}

// Returns a view of an array that `values` keeps alive. The cast throws if the array is not C-contiguous or has another
// dtype.
template <class T>
[[nodiscard]] std::span<const T> view(const py::dict& values, const char* name) {
  const auto array = py::cast<py::array>(values[name]);
  if (!py::isinstance<Array<T>>(array)) throw std::invalid_argument(std::string("_core: wrong dtype of ") + name);
  return {static_cast<const T*>(array.data()), static_cast<std::size_t>(array.size())};
}

template <class T, class Scalar>
[[nodiscard]] std::span<const T> rows_of(std::span<const Scalar> scalars) {
  constexpr std::size_t kWidth = sizeof(T) / sizeof(Scalar);
  return {reinterpret_cast<const T*>(scalars.data()), scalars.size() / kWidth};
}

// Bind ----------------------------------------------------------------------------------------------------------------
// Each part of the module has a function that binds it.

// Returns a view of the pixels. The Python layer has checked them and keeps them alive.
[[nodiscard]] Texture read_image(const py::handle& value);
void read_appearance(const py::dict& values, Appearance& appearance);

// Removes the constructor of a class from Python. Otherwise `__new__` alone would return an object without a C++ value
// (pybind11), and its first method would work on uninitialised memory.
void make_only_natively(const pybind11::handle& native_class);

void bind_errors(pybind11::module_& module);
void bind_threads(pybind11::module_& module);
void bind_isa(pybind11::module_& module);
void bind_scene(pybind11::module_& module);
void bind_queries(pybind11::module_& module);
void bind_render(pybind11::module_& module);
void bind_nodes(pybind11::module_& module);
void bind_filter(pybind11::module_& module);
void bind_statistics(pybind11::module_& module);
void bind_bulk(pybind11::module_& module);
void bind_curve_chains(pybind11::module_& module);

// Build settings ------------------------------------------------------------------------------------------------------
// Reads from the Python layer's settings how to build the tree of a mesh.

namespace py = pybind11;

inline BuildConfig parse_config(const py::dict& settings) {
  BuildConfig config;
  config.builder = find_builder(settings["builder"].cast<std::string>());
  config.optimize_passes = settings["optimize"].cast<std::uint32_t>();
  config.bins = settings["bins"].cast<std::uint32_t>();
  config.axes = settings["axes"].cast<std::uint32_t>();
  config.max_leaf_size = settings["max_leaf_size"].cast<std::uint32_t>();
  config.duplication_budget = settings["duplication_budget"].cast<float>();
  if (settings.contains("traversal_cost")) config.traversal_cost = settings["traversal_cost"].cast<float>();
  if (settings.contains("intersection_cost")) config.intersection_cost = settings["intersection_cost"].cast<float>();
  return config;
}

inline Usage parse_usage(const std::string& name) {
  if (name == "static") return Usage::kStatic;
  if (name == "deforming") return Usage::kDeforming;
  if (name == "changing") return Usage::kChanging;
  throw InvalidArgument("usage must be 'static', 'deforming' or 'changing', got '" + name + "'");
}

// Progress ------------------------------------------------------------------------------------------------------------
// How native calls react to Ctrl-C, to a Python `progress` callable, and to a flag that another thread sets.

namespace py = pybind11;

// Passed as `progress`, it stops a call as soon as it is set: every thread of the call polls it, without the GIL.
struct StopFlag {
  std::atomic<bool> is_set{false};
};

// Returns a token whose callback takes the GIL, checks for signals (which may raise KeyboardInterrupt) and, if
// `progress` is not None, asks progress(fraction) whether to continue: only an explicit False stops the call.
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

// Runs work(cancel) with the GIL released. An exception raised by the callback reaches the caller unchanged.
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

// Step times ----------------------------------------------------------------------------------------------------------
// The times at which a motion reaches its steps.

// The first and last steps are at the ends of the range.
inline StepTimes step_times(std::size_t steps, const std::pair<float, float>& range) {
  const auto last = static_cast<std::uint32_t>(steps - 1);
  return {range.first, static_cast<float>(last) / (range.second - range.first), last};
}

// Camera --------------------------------------------------------------------------------------------------------------
// Builds cameras and shutters from values that the Python layer has checked.

[[nodiscard]] Camera read_camera(const py::dict& values);
[[nodiscard]] Shutter read_shutter(const py::dict& values);

// Round edits ---------------------------------------------------------------------------------------------------------
// Binds the edits of a scene's curves and points.

void bind_round_edits(pybind11::class_<Scene>& scene);

}  // namespace perfect_bvh::bindings
