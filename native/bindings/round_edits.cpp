// Input was checked for shape and dtype by the Python face; the engine checks the values.
#include "bindings/round_edits.h"

#include <pybind11/stl.h>

#include <utility>

#include "bindings/arrays.h"
#include "bindings/build_settings.h"
#include "bindings/step_times.h"

namespace perfect_bvh::bindings {
namespace {

template <class T>
BallsGiven<T> as_balls(const Array<T>& centres, const Array<T>& radii) {
  return {as_vectors(centres), as_span(radii)};
}

CurveShape shape_of(bool is_ribbon) noexcept { return is_ribbon ? CurveShape::kRibbon : CurveShape::kRound; }

template <class T>
std::int32_t add_points(Scene& scene, const Array<T>& centres, const Array<T>& radii, const py::dict& settings,
                        const std::string& usage) {
  const BuildConfig config = parse_config(settings);
  const Usage expected = parse_usage(usage);
  const auto balls = as_balls(centres, radii);
  const py::gil_scoped_release release;
  return scene.add_mesh(make_points(balls, "add_points"), config, expected);
}

template <class T>
std::int32_t add_curves(Scene& scene, const Array<T>& points, const Array<T>& radii, const Array<std::int64_t>& offsets,
                        const Array<std::uint8_t>& cyclic, bool is_ribbon, const py::dict& settings,
                        const std::string& usage) {
  const BuildConfig config = parse_config(settings);
  const Usage expected = parse_usage(usage);
  const auto balls = as_balls(points, radii);
  const auto starts = as_span(offsets);
  const auto closed = as_span(cyclic);
  const py::gil_scoped_release release;
  return scene.add_mesh(make_curves(balls, starts, shape_of(is_ribbon), "add_curves", closed), config, expected);
}

template <class T>
void replace_points(Scene& scene, std::int32_t mesh_id, const Array<T>& centres, const Array<T>& radii) {
  const auto balls = as_balls(centres, radii);
  const py::gil_scoped_release release;
  scene.replace_mesh(mesh_id, make_points(balls, "replace_points"), "replace_points");
}

template <class T>
void replace_curves(Scene& scene, std::int32_t mesh_id, const Array<T>& points, const Array<T>& radii,
                    const Array<std::int64_t>& offsets, const Array<std::uint8_t>& cyclic, bool is_ribbon) {
  const auto balls = as_balls(points, radii);
  const auto starts = as_span(offsets);
  const auto closed = as_span(cyclic);
  const py::gil_scoped_release release;
  scene.replace_mesh(mesh_id, make_curves(balls, starts, shape_of(is_ribbon), "replace_curves", closed),
                     "replace_curves");
}

template <class T>
void set_chains(Scene& scene, std::int32_t mesh_id, const Array<T>& centres, const Array<T>& radii,
                const Array<std::int64_t>& offsets) {
  const auto balls = as_balls(centres, radii);
  const auto starts = as_span(offsets);
  const py::gil_scoped_release release;
  scene.set_chains(mesh_id, balls, starts);
}

template <class T, PrimitiveKind kKind>
void update_balls(Scene& scene, std::int32_t mesh_id, const Array<T>& centres, const Array<T>& radii) {
  const auto balls = as_balls(centres, radii);
  const py::gil_scoped_release release;
  scene.update_balls(mesh_id, kKind, balls, ThreadPool::shared());
}

// Of all steps, one after another; no offsets: those that there are.
template <class T, PrimitiveKind kKind>
void set_motion(Scene& scene, std::int32_t mesh_id, const Array<T>& centres, const Array<T>& radii,
                const Array<std::int64_t>& offsets, std::size_t steps, const std::pair<float, float>& range) {
  const auto balls = as_balls(centres, radii);
  const auto starts = as_span(offsets);
  const py::gil_scoped_release release;
  scene.set_round_motion(mesh_id, kKind, balls, starts, step_times(steps, range));
}

template <class T>
void bind_edits_of(py::class_<Scene>& scene) {
  scene.def("add_points", &add_points<T>, py::arg("centers").noconvert(), py::arg("radii").noconvert(),
            py::arg("settings"), py::arg("usage"));
  scene.def("add_curves", &add_curves<T>, py::arg("points").noconvert(), py::arg("radii").noconvert(),
            py::arg("curve_offsets").noconvert(), py::arg("cyclic").noconvert(), py::arg("is_ribbon"),
            py::arg("settings"), py::arg("usage"));
  scene.def("update_points", &update_balls<T, PrimitiveKind::kPoints>, py::arg("mesh_id"),
            py::arg("centers").noconvert(), py::arg("radii").noconvert());
  scene.def("update_curves", &update_balls<T, PrimitiveKind::kCurves>, py::arg("mesh_id"),
            py::arg("points").noconvert(), py::arg("radii").noconvert());
  scene.def("set_points_motion", &set_motion<T, PrimitiveKind::kPoints>, py::arg("mesh_id"),
            py::arg("centers").noconvert(), py::arg("radii").noconvert(), py::arg("offsets").noconvert(),
            py::arg("steps"), py::arg("time_range"));
  scene.def("set_curves_motion", &set_motion<T, PrimitiveKind::kCurves>, py::arg("mesh_id"),
            py::arg("points").noconvert(), py::arg("radii").noconvert(), py::arg("offsets").noconvert(),
            py::arg("steps"), py::arg("time_range"));
  scene.def("set_chains", &set_chains<T>, py::arg("mesh_id"), py::arg("centers").noconvert(),
            py::arg("radii").noconvert(), py::arg("offsets").noconvert());
  scene.def("replace_points", &replace_points<T>, py::arg("mesh_id"), py::arg("centers").noconvert(),
            py::arg("radii").noconvert());
  scene.def("replace_curves", &replace_curves<T>, py::arg("mesh_id"), py::arg("points").noconvert(),
            py::arg("radii").noconvert(), py::arg("curve_offsets").noconvert(), py::arg("cyclic").noconvert(),
            py::arg("is_ribbon"));
}

}  // namespace

void bind_round_edits(py::class_<Scene>& scene) {
  bind_edits_of<float>(scene);
  bind_edits_of<double>(scene);
}

}  // namespace perfect_bvh::bindings
