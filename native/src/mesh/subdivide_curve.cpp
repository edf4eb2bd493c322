#include "mesh/subdivide_curve.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/errors.h"
#include "math/round_segment.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kMostBalls = std::size_t{kSegmentBall} + 1;

// A sphere in double precision, or a difference of spheres: a vector of four.
struct Four {
  double x, y, z, radius;

  friend Four operator+(Four a, Four b) noexcept { return {a.x + b.x, a.y + b.y, a.z + b.z, a.radius + b.radius}; }
  friend Four operator-(Four a, Four b) noexcept { return {a.x - b.x, a.y - b.y, a.z - b.z, a.radius - b.radius}; }
  friend Four operator*(Four a, double s) noexcept { return {a.x * s, a.y * s, a.z * s, a.radius * s}; }
  // Returns the size of the centre plus that of the radius: how far a surface can differ by that.
  [[nodiscard]] double size() const noexcept { return std::sqrt(x * x + y * y + z * z) + std::abs(radius); }
};

// The Bernstein coefficients of a span.
struct Cubic {
  Four b0, b1, b2, b3;
};

template <class T>
Four control(const ControlCurves<T>& curves, const Reading& curve, std::size_t index) noexcept {
  const std::size_t row = curve.first + index;
  const Vec3<T>& point = curves.points[row];
  return {static_cast<double>(point.x), static_cast<double>(point.y), static_cast<double>(point.z),
          static_cast<double>(curves.radii[curves.radii.size() == 1 ? 0 : row])};
}

template <class T>
Cubic catmull_rom(const ControlCurves<T>& curves, const Reading& curve, std::size_t span) noexcept {
  const std::size_t last = curve.count - 1;
  const auto at = [&](std::size_t index) { return control(curves, curve, index); };
  const std::size_t next = span == last ? 0 : span + 1;  // for a cyclic curve
  const Four p0 = at(span != 0 ? span - 1 : curve.is_cyclic ? last : 0), p1 = at(span), p2 = at(next);
  const Four p3 = at(next != last ? next + 1 : curve.is_cyclic ? 0 : last);
  return {p1, p1 + (p2 - p0) * (1.0 / 6.0), p2 - (p3 - p1) * (1.0 / 6.0), p2};
}

template <class T>
Cubic b_spline(const ControlCurves<T>& curves, const Reading& curve, std::size_t span) noexcept {
  const auto at = [&](std::size_t index) {
    return control(curves, curve, index < curve.count ? index : index - curve.count);
  };
  const Four p0 = at(span), p1 = at(span + 1), p2 = at(span + 2), p3 = at(span + 3);
  const double third = 1.0 / 3.0, sixth = 1.0 / 6.0;
  return {(p0 + p1 * 4.0 + p2) * sixth, (p1 * 2.0 + p2) * third, (p1 + p2 * 2.0) * third, (p1 + p2 * 4.0 + p3) * sixth};
}

template <class T>
Cubic bezier(const ControlCurves<T>& curves, const Reading& curve, std::size_t span) noexcept {
  const auto at = [&](std::size_t index) { return control(curves, curve, index == curve.count ? 0 : index); };
  return {at(3 * span), at(3 * span + 1), at(3 * span + 2), at(3 * span + 3)};
}

// Returns a span that is not a line.
template <class T>
Cubic cubic_of(const ControlCurves<T>& curves, const Reading& curve, std::size_t span) noexcept {
  if (curve.kind == CurveKind::kBezier) return bezier(curves, curve, span);
  if (curve.kind == CurveKind::kBSpline) return b_spline(curves, curve, span);
  Cubic cubic = catmull_rom(curves, curve, span);
  cubic.b1.radius = std::max(cubic.b1.radius, 0.0);
  cubic.b2.radius = std::max(cubic.b2.radius, 0.0);
  return cubic;
}

// Returns the error of the surface for a single segment. The combined bend of centre and radius is largest at an end,
// too.
double bend_of(const Cubic& cubic) noexcept {
  const double first = ((cubic.b0 - cubic.b1) - (cubic.b1 - cubic.b2)).size();
  const double last = ((cubic.b1 - cubic.b2) - (cubic.b2 - cubic.b3)).size();
  return first >= last ? 0.75 * first : last >= first ? 0.75 * last : first + last;  // NaN stays NaN
}

std::uint32_t pieces_within(double bend, double tolerance) noexcept {
  const double count = std::ceil(std::sqrt(bend / tolerance));
  // NaN also becomes too many.
  return count <= static_cast<double>(kMostBalls) ? std::max(1u, static_cast<std::uint32_t>(count)) : kMostBalls;
}

// Starts with the existing spans, without segments yet.
template <class T>
Subdivision begin(const ControlCurves<T>& curves, const char* function) {
  Subdivision subdivision;
  subdivision.first_spans = first_spans_of(curves, function);
  subdivision.first_balls.resize(static_cast<std::size_t>(subdivision.first_spans.back()) + 1);
  return subdivision;
}

// Gives each span of a curve as many segments as the one with the most.
void even_out(Subdivision& subdivision) noexcept {
  const auto begin = subdivision.first_balls.begin();
  for (std::size_t curve = 1; curve < subdivision.first_spans.size(); ++curve) {
    const auto first = begin + subdivision.first_spans[curve - 1], end = begin + subdivision.first_spans[curve];
    if (first != end) std::fill(first, end, *std::max_element(first, end));
  }
}

// Converts the number of segments of each span to the first sphere of each: a chain has one sphere more than segments.
void sum_up(Subdivision& subdivision, const std::string& function) {
  std::size_t balls = 0, span = 0;
  for (std::size_t curve = 1; curve < subdivision.first_spans.size(); ++curve) {
    for (const auto end = static_cast<std::size_t>(subdivision.first_spans[curve]); span < end; ++span) {
      const std::uint32_t pieces = subdivision.first_balls[span];
      subdivision.first_balls[span] = static_cast<std::uint32_t>(balls);
      balls += pieces;
      if (balls >= kMostBalls) {
        throw InvalidArgument(function + ": a mesh of curves holds at most 2**30 spheres, and curve " +
                              std::to_string(curve - 1) +
                              " exceeds that; raise the tolerance, or divide the curves into several meshes");
      }
    }
    ++balls;
  }
  subdivision.first_balls[span] = static_cast<std::uint32_t>(std::min(balls, kMostBalls));
}

// Calls body(curve, its number, number of the span in it, number of the span) for each of a range of spans.
template <class T, class Body>
void for_spans(const ControlCurves<T>& curves, const Subdivision& subdivision, std::size_t begin, std::size_t end,
               const Body& body) {
  const auto& first_spans = subdivision.first_spans;
  const auto after = std::upper_bound(first_spans.begin(), first_spans.end(), static_cast<std::int64_t>(begin));
  auto curve = static_cast<std::size_t>(after - first_spans.begin()) - 1;
  for (std::size_t span = begin; span < end; ++curve) {
    const Reading reading = read(curves, curve);
    const auto first = static_cast<std::size_t>(first_spans[curve]);
    const std::size_t stop = std::min(end, static_cast<std::size_t>(first_spans[curve + 1]));
    for (; span < stop; ++span) body(reading, curve, span - first, span);
  }
}

template <class T>
struct Chains {
  std::span<Vec3<T>> centres;
  std::span<T> radii;

  void put(std::size_t row, const Four& ball) const noexcept {
    centres[row] = {static_cast<T>(ball.x), static_cast<T>(ball.y), static_cast<T>(ball.z)};
    radii[row] = static_cast<T>(std::max(ball.radius, 0.0));  // a cubic that touches 0 may be rounded below it
  }
  // Writes the first spheres of `count` segments, at 0, 1 / count, ... of the cubic.
  void put(std::size_t row, std::size_t count, const Cubic& cubic) const noexcept {
    const auto& [b0, b1, b2, b3] = cubic;
    put(row, b0);
    if (count == 1) return;
    const Four c1 = (b1 - b0) * 3.0, c2 = ((b0 - b1) - (b1 - b2)) * 3.0, c3 = (b3 - b0) - (b2 - b1) * 3.0;
    const double step = 1.0 / static_cast<double>(count);
    for (std::size_t k = 1; k < count; ++k) {
      const double t = static_cast<double>(k) * step;
      put(row + k, ((c3 * t + c2) * t + c1) * t + b0);
    }
  }
};

}  // namespace

std::vector<std::int64_t> Subdivision::ball_offsets() const {
  std::vector<std::int64_t> offsets(first_spans.size());
  for (std::size_t curve = 0; curve < offsets.size(); ++curve) {
    offsets[curve] = first_balls[static_cast<std::size_t>(first_spans[curve])];
  }
  return offsets;
}

bool Subdivision::is_as_fine_as(const Subdivision& other) const noexcept {
  if (first_spans != other.first_spans) return false;
  for (std::size_t curve = 0; curve + 1 < first_spans.size(); ++curve) {
    const auto first = static_cast<std::size_t>(first_spans[curve]),
               end = static_cast<std::size_t>(first_spans[curve + 1]);
    if (first_balls[end] - first_balls[first] < other.first_balls[end] - other.first_balls[first]) return false;
  }
  return true;
}

Subdivision Subdivision::finer(const Subdivision& other) const {
  Subdivision both;
  both.first_spans = first_spans;
  std::uint32_t ball = 0;
  for (std::size_t curve = 0; curve + 1 < first_spans.size(); ++curve) {
    const auto first = static_cast<std::size_t>(first_spans[curve]),
               end = static_cast<std::size_t>(first_spans[curve + 1]);
    const std::uint32_t balls =
        std::max(first_balls[end] - first_balls[first], other.first_balls[end] - other.first_balls[first]);
    const auto spans = static_cast<std::uint32_t>(end - first);
    for (std::uint32_t span = 0; span < spans; ++span) both.first_balls.push_back(ball + span * ((balls - 1) / spans));
    ball += balls;
  }
  both.first_balls.push_back(ball);
  return both;
}

template <class T>
Subdivision subdivide(const ControlCurves<T>& curves, double tolerance, const RangeLoop& loop, const char* function) {
  if (!(tolerance > 0.0)) {
    throw InvalidArgument(std::string(function) + ": tolerance must be above 0, got " + std::to_string(tolerance) +
                          "; a tenth of the radius is hardly seen");
  }
  Subdivision subdivision = begin(curves, function);
  loop(subdivision.span_count(), [&](std::size_t first, std::size_t last) {
    for_spans(curves, subdivision, first, last,
              [&](const Reading& curve, std::size_t, std::size_t span_of_curve, std::size_t span) {
                subdivision.first_balls[span] =
                    curve.kind == CurveKind::kPoly
                        ? 1
                        : pieces_within(bend_of(cubic_of(curves, curve, span_of_curve)), tolerance);
              });
  });
  even_out(subdivision);
  sum_up(subdivision, function);
  return subdivision;
}

template <class T>
Subdivision subdivide_evenly(const ControlCurves<T>& curves, std::uint32_t piece_count, const char* function) {
  if (piece_count == 0) throw InvalidArgument(std::string(function) + ": a span has 1 segment or more, got 0");
  Subdivision subdivision = begin(curves, function);
  for_spans(curves, subdivision, 0, subdivision.span_count(),
            [&](const Reading& curve, std::size_t, std::size_t, std::size_t span) {
              subdivision.first_balls[span] = curve.kind == CurveKind::kPoly ? 1 : piece_count;
            });
  sum_up(subdivision, function);
  return subdivision;
}

template <class T>
void write_balls(const ControlCurves<T>& curves, const Subdivision& subdivision, std::span<Vec3<T>> centres,
                 std::span<T> radii, const RangeLoop& loop, const char* function) {
  if (first_spans_of(curves, function) != subdivision.first_spans) {
    throw InvalidArgument(std::string(function) + ": curve_offsets and cyclic must be those that the curves were " +
                          "added with, got others; replace the curves instead");
  }
  const Chains<T> chains{centres, radii};
  loop(subdivision.span_count(), [&](std::size_t first, std::size_t last) {
    for_spans(curves, subdivision, first, last,
              [&](const Reading& curve, std::size_t number, std::size_t span_of_curve, std::size_t span) {
                const bool is_last = subdivision.first_spans[number + 1] == static_cast<std::int64_t>(span) + 1;
                const std::size_t row = subdivision.first_balls[span];
                const std::size_t pieces = subdivision.first_balls[span + 1] - row - (is_last ? 1 : 0);
                if (curve.kind == CurveKind::kPoly) {
                  chains.put(row, control(curves, curve, span_of_curve));
                  if (is_last) chains.put(row + 1, control(curves, curve, (span_of_curve + 1) % curve.count));
                  return;
                }
                const Cubic cubic = cubic_of(curves, curve, span_of_curve);
                chains.put(row, pieces, cubic);
                if (is_last) chains.put(row + pieces, curve.is_cyclic ? cubic_of(curves, curve, 0).b0 : cubic.b3);
              });
  });
}

template Subdivision subdivide(const ControlCurves<float>&, double, const RangeLoop&, const char*);
template Subdivision subdivide(const ControlCurves<double>&, double, const RangeLoop&, const char*);
template Subdivision subdivide_evenly(const ControlCurves<float>&, std::uint32_t, const char*);
template Subdivision subdivide_evenly(const ControlCurves<double>&, std::uint32_t, const char*);
template void write_balls(const ControlCurves<float>&, const Subdivision&, std::span<Vec3f>, std::span<float>,
                          const RangeLoop&, const char*);
template void write_balls(const ControlCurves<double>&, const Subdivision&, std::span<Vec3d>, std::span<double>,
                          const RangeLoop&, const char*);

// Control curves ------------------------------------------------------------------------------------------------------

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
