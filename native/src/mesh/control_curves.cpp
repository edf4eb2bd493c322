#include "mesh/control_curves.h"

#include "core/errors.h"

namespace perfect_bvh {
namespace {

std::string text_of(std::size_t number) { return std::to_string(number); }

template <class T>
void check_curve(const ControlCurves<T>& curves, std::size_t curve, const std::string& function) {
  const Reading given = read(curves, curve);
  if (curves.kind == CurveKind::kBezier) {
    const std::size_t left = given.count % 3;
    if (given.count >= 3 && left == (given.is_cyclic ? 0 : 1)) return;
    throw InvalidArgument(function + ": curve " + text_of(curve) + " must have " +
                          (given.is_cyclic ? "3 n points, being a cyclic" : "3 n + 1 points, being a") +
                          " Bezier curve, n at least 1, got " + text_of(given.count) +
                          "; give each point with the handles before and after it");
  }
  if (given.count >= 2) return;
  throw InvalidArgument(function + ": curve " + text_of(curve) + " must have 2 points or more, got " +
                        text_of(given.count) + "; leave the curve out, or add its point by add_points");
}

template <class T>
void check_offsets(const ControlCurves<T>& curves, const std::string& function) {
  const auto& offsets = curves.offsets;
  const auto total = static_cast<std::int64_t>(curves.points.size());
  if (offsets.empty() || offsets.front() != 0 || offsets.back() != total) {
    throw InvalidArgument(
        function + ": curve_offsets must go from 0 to the number of points, " + std::to_string(total) + ", got " +
        (offsets.empty() ? "none" : std::to_string(offsets.front()) + " to " + std::to_string(offsets.back())) +
        "; give the first point of each curve, then the number of points");
  }
  for (std::size_t curve = 0; curve + 1 < offsets.size(); ++curve) {
    if (offsets[curve] <= offsets[curve + 1]) continue;
    throw InvalidArgument(function + ": curve_offsets must not descend, got " + std::to_string(offsets[curve]) +
                          " and then " + std::to_string(offsets[curve + 1]) + " in rows " + text_of(curve) + " and " +
                          text_of(curve + 1) + "; sort the curves' points by curves");
  }
}

}  // namespace

template <class T>
std::vector<std::int64_t> first_spans_of(const ControlCurves<T>& curves, const std::string& function) {
  check_offsets(curves, function);
  const std::size_t curve_count = curves.offsets.size() - 1;
  if (!curves.is_cyclic.empty() && curves.is_cyclic.size() != curve_count) {
    throw InvalidArgument(function + ": cyclic must have a row for each of " + text_of(curve_count) + " curves, got " +
                          text_of(curves.is_cyclic.size()));
  }
  if (curves.radii.size() != 1 && curves.radii.size() != curves.points.size()) {
    throw InvalidArgument(function + ": radii must be one number or one a point, " + text_of(curves.points.size()) +
                          ", got " + text_of(curves.radii.size()));
  }
  std::vector<std::int64_t> first_spans(curve_count + 1);
  std::int64_t spans = 0;
  for (std::size_t curve = 0; curve < curve_count; ++curve) {
    check_curve(curves, curve, function);
    first_spans[curve] = spans;
    spans += static_cast<std::int64_t>(read(curves, curve).span_count());
  }
  first_spans.back() = spans;
  return first_spans;
}
template std::vector<std::int64_t> first_spans_of(const ControlCurves<float>&, const std::string&);
template std::vector<std::int64_t> first_spans_of(const ControlCurves<double>&, const std::string&);

}  // namespace perfect_bvh
