#include <pybind11/stl.h>

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>

#include "bindings/bind.h"
#include "core/thread_pool.h"
#include "mesh/round_mesh.h"
#include "mesh/subdivide_curve.h"
#include "query/tree_boxes.h"

namespace perfect_bvh::bindings {
namespace {

py::dict to_dict(const TreeStatistics& tree) {
  py::dict row;
  row["mesh_id"] = tree.mesh_id;
  row["builder"] = tree.builder;
  row["kind"] = tree.kind;
  row["primitive_count"] = tree.primitive_count;
  row["vertex_count"] = tree.vertex_count;
  row["left_out_count"] = tree.left_out_count;
  row["user_count"] = tree.user_count;
  row["is_refittable"] = tree.is_refittable;
  row["node_count"] = tree.node_count;
  row["leaf_count"] = tree.leaf_count;
  row["reference_count"] = tree.reference_count;
  row["max_leaf_size"] = tree.max_leaf_size;
  row["depth"] = tree.depth;
  row["sah"] = tree.sah;
  row["sibling_overlap"] = tree.sibling_overlap;
  row["epo"] = tree.epo;
  row["leaf_count_variability"] = tree.leaf_count_variability;
  row["wide_node_count"] = tree.wide_node_count;
  row["wide_leaf_count"] = tree.wide_leaf_count;
  row["wide_depth"] = tree.wide_depth;
  row["geometry_byte_count"] = tree.geometry_byte_count;
  row["wide_byte_count"] = tree.wide_byte_count;
  row["plan_byte_count"] = tree.plan_byte_count;
  row["motion_byte_count"] = tree.motion_byte_count;
  row["byte_count"] = tree.byte_count;
  return row;
}

py::dict to_dict(const SceneStatistics& statistics) {
  py::list meshes;
  for (const TreeStatistics& mesh : statistics.meshes) meshes.append(to_dict(mesh));
  return py::dict(py::arg("meshes") = meshes, py::arg("top_level") = to_dict(statistics.top_level),
                  py::arg("triangle_count") = statistics.distinct.triangles,
                  py::arg("segment_count") = statistics.distinct.segments,
                  py::arg("point_count") = statistics.distinct.points,
                  py::arg("instanced_triangle_count") = statistics.instanced.triangles,
                  py::arg("instanced_segment_count") = statistics.instanced.segments,
                  py::arg("instanced_point_count") = statistics.instanced.points,
                  py::arg("instance_count") = statistics.instance_count, py::arg("byte_count") = statistics.byte_count,
                  py::arg("generation") = statistics.generation);
}

py::dict to_dict(const TreeBoxes& boxes) {
  return py::dict(
      py::arg("boxes") = to_column(boxes.corners).reshape({-1, 2, 3}), py::arg("levels") = to_column(boxes.levels),
      py::arg("leaf_sizes") = to_column(boxes.leaf_sizes), py::arg("costs") = to_column(boxes.costs),
      py::arg("subtree_costs") = to_column(boxes.subtree_costs), py::arg("overlaps") = to_column(boxes.overlaps),
      py::arg("ranges") = to_column(boxes.ranges).reshape({-1, 2}), py::arg("primitives") = to_column(boxes.primitives),
      py::arg("depth") = boxes.depth, py::arg("sah") = boxes.sah, py::arg("built_sah") = boxes.built_sah);
}

}  // namespace

void bind_statistics(py::module_& module) {
  module.def(
      "measure",
      [](const Snapshot& snapshot, bool detailed, const py::object& progress) {
        return to_dict(with_progress(
            progress, [&](CancelToken& cancel) { return measure(snapshot, detailed, ThreadPool::shared(), cancel); }));
      },
      py::arg("snapshot"), py::arg("detailed"), py::arg("progress"));
  module.def(
      "tree_boxes",
      [](const Snapshot& snapshot, std::optional<std::int32_t> mesh_id, std::uint32_t first_level,
         std::uint32_t last_level, bool with_leaves_above) {
        return to_dict(with_progress(py::none(), [&](CancelToken& cancel) {
          return list_tree_boxes(snapshot, mesh_id, {first_level, last_level, with_leaves_above}, cancel);
        }));
      },
      py::arg("snapshot"), py::arg("mesh_id"), py::arg("first_level"), py::arg("last_level"),
      py::arg("with_leaves_above"));
  module.def(
      "tree_sah",
      [](const Snapshot& snapshot, std::int32_t mesh_id) {
        return with_progress(py::none(), [&](CancelToken& cancel) { return tree_sah(snapshot, mesh_id, cancel); });
      },
      py::arg("snapshot"), py::arg("mesh_id"));
}

// Curve chains --------------------------------------------------------------------------------------------------------
// Divides curves over control points into chains of spheres. The Python layer has checked shapes and dtypes of inputs;
// the functions here check the values.

namespace {

constexpr std::size_t kSpansAtOnce = 4096;

void share_spans(std::size_t count, const std::function<void(std::size_t, std::size_t)>& body) {
  parallel_for(ThreadPool::shared(), count, kSpansAtOnce, body);
}

CurveKind parse_kind(const std::string& name) {
  if (name == "poly") return CurveKind::kPoly;
  if (name == "catmull_rom") return CurveKind::kCatmullRom;
  if (name == "bezier") return CurveKind::kBezier;
  if (name == "b_spline") return CurveKind::kBSpline;
  throw std::invalid_argument("_core: unknown kind of curve " + name);
}

// The arguments that all functions here share, in this order. They own the memory that the view points to.
template <class T>
struct Given {
  const Array<T>& points;
  const Array<T>& radii;
  const Array<std::int64_t>& offsets;
  const Array<std::uint8_t>& cyclic;
  CurveKind kind;

  [[nodiscard]] ControlCurves<T> view() const {
    return {kind, as_vectors(points), as_span(radii), as_span(offsets), as_span(cyclic)};
  }
};

// piece_count: segments of each span; 0: as many as the tolerance requires.
template <class T>
Subdivision divide_curves(const Array<T>& points, const Array<T>& radii, const Array<std::int64_t>& offsets,
                          const Array<std::uint8_t>& cyclic, const std::string& kind, double tolerance,
                          std::uint32_t piece_count, const std::string& function) {
  const ControlCurves<T> curves = Given<T>{points, radii, offsets, cyclic, parse_kind(kind)}.view();
  const py::gil_scoped_release release;
  check_balls(BallsGiven<T>{curves.points, curves.radii}, PrimitiveKind::kCurves, function.c_str());
  return piece_count > 0 ? subdivide_evenly(curves, piece_count, function.c_str())
                         : subdivide(curves, tolerance, share_spans, function.c_str());
}

template <class T>
std::pair<Array<T>, Array<T>> balls_of(const Subdivision& subdivision, const Array<T>& points, const Array<T>& radii,
                                       const Array<std::int64_t>& offsets, const Array<std::uint8_t>& cyclic,
                                       const std::string& kind, const std::string& function) {
  const ControlCurves<T> curves = Given<T>{points, radii, offsets, cyclic, parse_kind(kind)}.view();
  const auto count = static_cast<py::ssize_t>(subdivision.ball_count());
  Array<T> centres({count, py::ssize_t{3}}), sizes(count);
  const std::span<Vec3<T>> rows{reinterpret_cast<Vec3<T>*>(centres.mutable_data()), subdivision.ball_count()};
  const std::span<T> column{sizes.mutable_data(), subdivision.ball_count()};
  {
    const py::gil_scoped_release release;
    check_balls(BallsGiven<T>{curves.points, curves.radii}, PrimitiveKind::kCurves, function.c_str());
    write_balls(curves, subdivision, rows, column, share_spans, function.c_str());
  }
  return {std::move(centres), std::move(sizes)};
}

template <class T>
void bind_curves_of(py::module_& module, py::class_<Subdivision>& subdivision) {
  module.def("divide_curves", &divide_curves<T>, py::arg("points").noconvert(), py::arg("radii").noconvert(),
             py::arg("curve_offsets").noconvert(), py::arg("cyclic").noconvert(), py::arg("kind"), py::arg("tolerance"),
             py::arg("piece_count"), py::arg("function"));
  subdivision.def("balls", &balls_of<T>, py::arg("points").noconvert(), py::arg("radii").noconvert(),
                  py::arg("curve_offsets").noconvert(), py::arg("cyclic").noconvert(), py::arg("kind"),
                  py::arg("function"));
}

}  // namespace

void bind_curve_chains(py::module_& module) {
  py::class_<Subdivision> subdivision(module, "Subdivision");
  make_only_natively(subdivision);
  subdivision.def_property_readonly("offsets", [](const Subdivision& self) { return to_column(self.ball_offsets()); })
      .def("is_as_fine_as", &Subdivision::is_as_fine_as, py::arg("other"))
      .def("finer", &Subdivision::finer, py::arg("other"));
  bind_curves_of<float>(module, subdivision);
  bind_curves_of<double>(module, subdivision);
}

}  // namespace perfect_bvh::bindings
