#include "scene/statistics.h"

#include "bindings/bind.h"

namespace perfect_bvh::bindings {

namespace py = pybind11;

namespace {

py::dict to_dict(const TreeStatistics& tree) {
  return py::dict(py::arg("mesh_id") = tree.mesh_id, py::arg("builder") = tree.builder,
                  py::arg("primitive_count") = tree.primitive_count, py::arg("vertex_count") = tree.vertex_count,
                  py::arg("node_count") = tree.node_count, py::arg("leaf_count") = tree.leaf_count,
                  py::arg("reference_count") = tree.reference_count, py::arg("depth") = tree.depth,
                  py::arg("sah") = tree.sah, py::arg("byte_count") = tree.byte_count,
                  py::arg("user_count") = tree.user_count);
}

}  // namespace

void bind_statistics(py::module_& module) {
  module.def(
      "measure",
      [](const Snapshot& snapshot) {
        SceneStatistics statistics;
        {
          const py::gil_scoped_release release;
          statistics = measure(snapshot);
        }
        py::list meshes;
        for (const TreeStatistics& mesh : statistics.meshes) meshes.append(to_dict(mesh));
        return py::dict(py::arg("meshes") = meshes, py::arg("top_level") = to_dict(statistics.top_level),
                        py::arg("triangle_count") = statistics.triangle_count,
                        py::arg("instanced_triangle_count") = statistics.instanced_triangle_count,
                        py::arg("instance_count") = statistics.instance_count,
                        py::arg("byte_count") = statistics.byte_count, py::arg("generation") = statistics.generation);
      },
      py::arg("snapshot"));
}

}  // namespace perfect_bvh::bindings
