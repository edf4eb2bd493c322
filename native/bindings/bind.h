// The parts that the module is bound in.
#pragma once

#include <pybind11/pybind11.h>

namespace perfect_bvh::bindings {

// Takes from a class the way to be made in Python. pybind11 lets `__new__` alone return an object without a C++ value,
// and the first method of such an object then works on memory that was never initialised.
void make_only_natively(const pybind11::handle& native_class);

void bind_errors(pybind11::module_& module);
void bind_threads(pybind11::module_& module);
void bind_isa(pybind11::module_& module);
void bind_scene(pybind11::module_& module);
void bind_queries(pybind11::module_& module);
void bind_render(pybind11::module_& module);
void bind_filter(pybind11::module_& module);
void bind_statistics(pybind11::module_& module);
void bind_bulk(pybind11::module_& module);
void bind_curve_chains(pybind11::module_& module);

}  // namespace perfect_bvh::bindings
