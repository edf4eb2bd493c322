// numpy arrays as spans. `_core` takes C-contiguous arrays of the exact dtype only: pybind11's default would copy in
// silence; the Python face converts where it can be seen.
#pragma once

#include <pybind11/numpy.h>

#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "math/vec3.h"

namespace perfect_bvh::bindings {

namespace py = pybind11;

template <class T>
using Array = py::array_t<T, py::array::c_style>;

// (rows, 3) as vectors.
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

// A copy.
template <class T>
Array<T> to_column(const std::vector<T>& values) {
  return Array<T>(static_cast<py::ssize_t>(values.size()), values.data());
}

}  // namespace perfect_bvh::bindings
