#include <pybind11/stl.h>

#include <string>
#include <vector>

#include "bindings/bind.h"
#include "traverse/dispatch.h"

namespace perfect_bvh::bindings {

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

}  // namespace perfect_bvh::bindings
