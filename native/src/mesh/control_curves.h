// Control points of curves as callers give them, and how many spans each curve has between them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

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

}  // namespace perfect_bvh
