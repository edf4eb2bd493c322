// Curves over control points, divided into chains of balls. Input was checked for shape and dtype by the Python face;
// here the values are.
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>

#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "core/thread_pool.h"
#include "mesh/round_mesh.h"
#include "mesh/subdivide_curve.h"

namespace perfect_bvh::bindings {
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

// The arguments of all that is called here, in this order; they own what the view points to.
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

// piece_count: of each span; 0: as many as the tolerance asks for.
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
