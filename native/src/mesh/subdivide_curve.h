// The control points of curves as callers give them, and the number of spans between them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "core/aligned.h"
#include "math/vec3.h"

namespace perfect_bvh {

enum class CurveKind : std::uint8_t { kPoly, kCatmullRom, kBezier, kBSpline };

// T: float or double. Callers check the numbers: finite, radii not negative.
template <class T>
struct ControlCurves {
  CurveKind kind;
  std::span<const Vec3<T>> points;
  std::span<const T> radii;                 // one for all, or one per point
  std::span<const std::int64_t> offsets;    // the first point of each curve, then the number of points
  std::span<const std::uint8_t> is_cyclic;  // one per curve; empty: none is
};

// How a curve is evaluated, which differs for a B-spline of few points.
struct Reading {
  CurveKind kind;
  std::size_t first, count;  // of its points
  bool is_cyclic;

  [[nodiscard]] std::size_t span_count() const noexcept {
    switch (kind) {
      case CurveKind::kBezier:
        return is_cyclic ? count / 3 : (count - 1) / 3;
      case CurveKind::kBSpline:
        return is_cyclic ? count : count - 3;
      default:
        return is_cyclic ? count : count - 1;
    }
  }
};

template <class T>
[[nodiscard]] Reading read(const ControlCurves<T>& curves, std::size_t curve) noexcept {
  const auto first = static_cast<std::size_t>(curves.offsets[curve]);
  const std::size_t count = static_cast<std::size_t>(curves.offsets[curve + 1]) - first;
  const bool is_few = curves.kind == CurveKind::kBSpline && count < 4;
  return {is_few ? CurveKind::kPoly : curves.kind, first, count,
          !curves.is_cyclic.empty() && curves.is_cyclic[curve] != 0};
}

// Returns the first span of each curve, then the number of spans. Throws InvalidArgument for invalid offsets, for
// curves with too few points or, for Bezier curves, with an incomplete handle; `function` opens the message.
template <class T>
[[nodiscard]] std::vector<std::int64_t> first_spans_of(const ControlCurves<T>& curves, const std::string& function);

// Subdivide curve -----------------------------------------------------------------------------------------------------
// Converts curves over control points to chains of spheres (math/round_segment.h), within a given distance of the true
// surface.
//
// The true surface. Between control points a curve is a cubic, in both the centre and the radius (poly: a line); the
// surface bounds the union of the spheres along it. Curves are evaluated as in Blender:
// - Catmull-Rom, uniform: through every control point; the first and the last count twice at the ends.
// - B-spline, cubic, with uniform knots, not clamped: from (p0 + 4 p1 + p2) / 6 on. With fewer than 4 points: a poly.
// - Bezier: through the points 3i, the two between are handles; there are 3n + 1 points, or 3n for a cyclic curve.
// A cyclic curve's chain ends with its first sphere. If a Catmull-Rom curve would let the radius swing below 0, its
// inner Bernstein coefficients are raised to 0, so that no radius is negative.
//
// The distance. Over 1/k of its parameter, a cubic deviates from its chord by at most |second derivative| / (8 k^2), in
// any norm: here that of the centre plus that of the radius, which bounds the difference of surfaces. The second
// derivative is linear, so it is largest at an end. Rounding the spheres to T adds to this.
//
// All spans of a curve get as many segments as the one that needs most, so that a position along the chain is the same
// position along the curve.

// The number of segments of each span between control points. It depends on the control points and the tolerance. It
// outlives them, so that the same chains can be written for moved points, and trees can be refitted.
struct Subdivision {
  AlignedVector<std::uint32_t> first_balls;  // of each span, curve by curve, then the number of spheres
  std::vector<std::int64_t> first_spans;     // of each curve, then the number of spans

  [[nodiscard]] std::size_t span_count() const noexcept { return first_balls.size() - 1; }
  [[nodiscard]] std::size_t ball_count() const noexcept { return first_balls.back(); }
  // Returns the first sphere of each curve, then the number of spheres: the offsets of a poly.
  [[nodiscard]] std::vector<std::int64_t> ball_offsets() const;
  // Returns whether it has at least as many segments everywhere as another of the same curves.
  [[nodiscard]] bool is_as_fine_as(const Subdivision& other) const noexcept;
  // Returns, for each curve, the segments of the one that has more; `other` is of the same curves.
  [[nodiscard]] Subdivision finer(const Subdivision& other) const;
};

// Calls body(begin, end) for parts that together are [0, count), on any threads; returns when all have ended.
using RangeLoop =
    std::function<void(std::size_t count, const std::function<void(std::size_t begin, std::size_t end)>& body)>;

// Makes chains that are nowhere farther than `tolerance` from the true surface. Throws InvalidArgument for a tolerance
// that is not above 0, for invalid offsets, for curves with too few points or, for Bezier curves, with an incomplete
// handle, and for more spheres than a mesh can hold; `function` opens the message.
template <class T>
[[nodiscard]] Subdivision subdivide(const ControlCurves<T>& curves, double tolerance, const RangeLoop& loop,
                                    const char* function);

// The same with a fixed number of segments per span; a poly has one.
template <class T>
[[nodiscard]] Subdivision subdivide_evenly(const ControlCurves<T>& curves, std::uint32_t piece_count,
                                           const char* function);

// Writes the spheres of all chains; centres and radii have room for ball_count(). The curves are those that were
// subdivided, or the same ones moved. Throws InvalidArgument if their offsets differ from those.
template <class T>
void write_balls(const ControlCurves<T>& curves, const Subdivision& subdivision, std::span<Vec3<T>> centres,
                 std::span<T> radii, const RangeLoop& loop, const char* function);

}  // namespace perfect_bvh
