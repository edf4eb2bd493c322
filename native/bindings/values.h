// Dictionaries from the Python face as values and spans.
#pragma once

#include <span>
#include <stdexcept>
#include <string>

#include "bindings/arrays.h"

namespace perfect_bvh::bindings {

template <class T>
[[nodiscard]] T get(const py::dict& values, const char* name) {
  return values[name].cast<T>();
}

// A view of an array that `values` keeps alive. C-contiguous and of the exact dtype, or the cast throws.
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

}  // namespace perfect_bvh::bindings
