// Control points of curves as callers give them, and how many spans each curve has between them.
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

// T: float or double. Numbers are checked by who gives them: finite, radii not negative.
template <class T>
struct ControlCurves {
  CurveKind kind;
  std::span<const Vec3<T>> points;
  std::span<const T> radii;                 // one for all, or one a point
  std::span<const std::int64_t> offsets;    // the first point of each curve, then how many points there are
  std::span<const std::uint8_t> is_cyclic;  // one a curve; empty: none is
};

// How a curve is read, which a B-spline of few points changes.
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

// The first span of each curve, then how many spans there are. Throws InvalidArgument for offsets that do not fit, for
// curves of too few points or, of Bezier curves, of a number that leaves a handle over; `function` opens the message.
template <class T>
[[nodiscard]] std::vector<std::int64_t> first_spans_of(const ControlCurves<T>& curves, const std::string& function);

// Subdivide curve -----------------------------------------------------------------------------------------------------
// Curves over control points as chains of balls (math/round_segment.h), within a stated distance of the true surface.
//
// What the true surface is. Between control points a curve is a cubic, of the centre and of the radius alike (poly: a
// line); the surface bounds the union of the balls along it. Curves run as Blender evaluates them:
// - Catmull-Rom, uniform: through every control point; the first and the last count twice at the ends.
// - B-spline, cubic, its knots uniform and not clamped: from (p0 + 4 p1 + p2) / 6 on. With less than 4 points: a poly.
// - Bezier: points 3i are passed through, the two between are handles; there are 3n + 1 points, or 3n of a cyclic one.
// A cyclic curve's chain ends with the ball that it begins with. Where a Catmull-Rom curve would let the radius swing
// below 0, the inner ones of its Bernstein coefficients are raised to 0: no radius is negative.
//
// The distance. Over 1/k of its parameter a cubic leaves its chord by |second derivative| / (8 k^2) at most, by any
// norm: here that of the centre plus that of the radius, by which surfaces can differ. The second derivative is linear,
// and so largest at an end. Rounding the balls to T comes on top.
//
// All spans of a curve get as many pieces as the one that needs most: so a place along the chain is the same place
// along the curve.

// Into how many pieces each span between control points is divided. A function of the control points and the
// tolerance; it outlives them, so that the same chains can be written of points that moved, and trees be refitted.
struct Subdivision {
  AlignedVector<std::uint32_t> first_balls;  // of each span, curve by curve, then how many balls there are
  std::vector<std::int64_t> first_spans;     // of each curve, then how many spans there are

  [[nodiscard]] std::size_t span_count() const noexcept { return first_balls.size() - 1; }
  [[nodiscard]] std::size_t ball_count() const noexcept { return first_balls.back(); }
  // The first ball of each curve, then how many balls there are: the offsets of a poly.
  [[nodiscard]] std::vector<std::int64_t> ball_offsets() const;
  // Whether it has as many pieces as another of the same curves everywhere, or more.
  [[nodiscard]] bool is_as_fine_as(const Subdivision& other) const noexcept;
  // Of each curve the pieces of whichever has more; `other` is of the same curves.
  [[nodiscard]] Subdivision finer(const Subdivision& other) const;
};

// Calls body(begin, end) for parts that together are [0, count), on whatever threads; returns when all have ended.
using RangeLoop =
    std::function<void(std::size_t count, const std::function<void(std::size_t begin, std::size_t end)>& body)>;

// Chains that are nowhere further than `tolerance` from the true surface. Throws InvalidArgument for a tolerance that
// is not above 0, for offsets that do not fit, for curves of too few points or, of Bezier curves, of a number that
// leaves a handle over, and if there were more balls than a mesh can hold; `function` opens the message.
template <class T>
[[nodiscard]] Subdivision subdivide(const ControlCurves<T>& curves, double tolerance, const RangeLoop& loop,
                                    const char* function);

// The same with so many pieces a span, of a poly one.
template <class T>
[[nodiscard]] Subdivision subdivide_evenly(const ControlCurves<T>& curves, std::uint32_t piece_count,
                                           const char* function);

// The balls of all chains: centres and radii have ball_count() places. The curves are those that were subdivided, or
// the same ones moved: throws InvalidArgument if their offsets differ from what they were then.
template <class T>
void write_balls(const ControlCurves<T>& curves, const Subdivision& subdivision, std::span<Vec3<T>> centres,
                 std::span<T> radii, const RangeLoop& loop, const char* function);

}  // namespace perfect_bvh
