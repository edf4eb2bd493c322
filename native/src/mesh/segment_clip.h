// Cuts a ball, or the convex hull of two, by parallel axis-aligned planes: a box for each slice, as spatial splits need
// them (mesh/triangle_clip.h is the same for triangles).
//
// The hull is the union of the balls between its two: centre and radius run evenly from the one to the other. What lies
// between two planes lies in those balls that reach between them, and the box of a row of such balls is that of its
// first and its last one. A slanted hull's box is that of its two balls' tangent planes as well: seen along an axis the
// hull is that of two discs, which lies on one side of both lines that touch both discs. The lesser of the two bounds
// is taken. Any line serves whose distance from the discs is known: how its direction was rounded is no matter.
//
// The boxes are conservative. All is reckoned in double precision and widened by 2^-22 of the largest coordinate M of
// the hull: 4 units of a float, more than what narrowing takes (half a unit). In double, u = 2^-53, a plane that is
// left away where the hull hardly rises towards it (less than 2^-20 M) lets a share of the balls be off by less than
// 8 u M / (2^-20 M) < 2^-29 of the way between them, which is 2 M at most. A tangent's place is off by less than
// 16 u M / ny, and it is left away where ny < 2^-20.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "math/ball.h"
#include "math/float4.h"

namespace perfect_bvh {

class SegmentSlicer {
 public:
  SegmentSlicer(const Ball& first, const Ball& last, int axis) noexcept : axis_(axis) {
    for (int i = 0; i < 3; ++i) {
      along_[i] = {{centre(first, i) - radius(first), centre(last, i) - radius(last)},
                   {centre(first, i) + radius(first), centre(last, i) + radius(last)}};
      const auto [low, high] = along_[i];
      lower_[i] = std::min(low.from, low.to), upper_[i] = std::max(high.from, high.to);
      size_ = std::max({size_, -lower_[i], upper_[i]});
    }
    for (int i = 0; i < 3; ++i) {
      if (i != axis) find_tangents(first, last, i);
    }
  }

  // The box of what lies between two planes, the first below the second; empty if nothing does.
  [[nodiscard]] Box4 between(double low, double high) const noexcept {
    if (low > upper_[axis_] || high < lower_[axis_]) return Box4::empty();
    const auto [first, last] = balls_between(low, high);
    double lower[3], upper[3];
    for (int i = 0; i < 3; ++i) {
      lower[i] = std::min(along_[i].lower.at(first), along_[i].lower.at(last));
      upper[i] = std::max(along_[i].upper.at(first), along_[i].upper.at(last));
    }
    const double from = std::max(low, lower_[axis_]), to = std::min(high, upper_[axis_]);
    for (std::size_t i = 0; i < tangent_count_; ++i) tangents_[i].cut(from, to, lower, upper);
    lower[axis_] = from, upper[axis_] = to;
    const double slack = 0x1p-22 * size_ + 0x1p-126;
    const auto narrow = [&](const double (&corner)[3], double by) {
      return Float4(static_cast<float>(corner[0] + by), static_cast<float>(corner[1] + by),
                    static_cast<float>(corner[2] + by), 0.0f);
    };
    return {narrow(lower, -slack), narrow(upper, slack)};
  }

 private:
  // A number that runs evenly from the first ball to the last.
  struct Run {
    double from, to;
    [[nodiscard]] double at(double share) const noexcept { return from + share * (to - from); }
  };
  // How far the balls reach along an axis.
  struct Reach {
    Run lower, upper;
  };
  struct Shares {
    double first, last;
  };
  // Every point of the hull has slope * coordinate[cut axis] + coordinate[across] <= place, or >= if it is below.
  struct Tangent {
    int across;
    bool is_above;
    double slope, place;

    void cut(double from, double to, double* lower, double* upper) const noexcept {
      const double at_from = place - slope * from, at_to = place - slope * to;
      if (is_above) {
        upper[across] = std::min(upper[across], std::max(at_from, at_to));
      } else {
        lower[across] = std::max(lower[across], std::min(at_from, at_to));
      }
    }
  };

  static double centre(const Ball& ball, int i) noexcept { return static_cast<double>(ball.centre[i]); }
  static double radius(const Ball& ball) noexcept { return static_cast<double>(ball.radius); }

  // Those that reach above the lower plane and below the upper one: all where that can hardly be told.
  [[nodiscard]] Shares balls_between(double low, double high) const noexcept {
    Shares shares{0, 1};
    const auto keep_above = [&](Run run, double place) {
      const double rise = run.to - run.from;
      if (!(std::abs(rise) > 0x1p-20 * size_)) return;
      const double share = std::clamp((place - run.from) / rise, 0.0, 1.0);
      if (rise > 0) {
        shares.first = std::max(shares.first, share);
      } else {
        shares.last = std::min(shares.last, share);
      }
    };
    const auto [lower, upper] = along_[axis_];
    keep_above(upper, low);
    keep_above({-lower.from, -lower.to}, -high);
    return shares;
  }

  // A line's normal n has n.d = r0 - r1, d from the first centre to the last: it touches both discs.
  void find_tangents(const Ball& first, const Ball& last, int across) noexcept {
    const double dx = centre(last, axis_) - centre(first, axis_), dy = centre(last, across) - centre(first, across);
    const double narrows = radius(first) - radius(last), squared = dx * dx + dy * dy;
    const double rest = squared - narrows * narrows;
    if (!(rest > 0)) return;  // one disc holds the other
    for (const double side : {-std::sqrt(rest), std::sqrt(rest)}) {
      const double nx = (narrows * dx - side * dy) / squared, ny = (narrows * dy + side * dx) / squared;
      if (!(std::abs(ny) > 0x1p-20)) continue;
      const double length = std::sqrt(nx * nx + ny * ny);
      const double place = std::max(nx * centre(first, axis_) + ny * centre(first, across) + radius(first) * length,
                                    nx * centre(last, axis_) + ny * centre(last, across) + radius(last) * length);
      tangents_[tangent_count_++] = {across, ny > 0, nx / ny, place / ny};
    }
  }

  int axis_;
  double size_ = 0;  // the largest magnitude of a coordinate
  double lower_[3], upper_[3];
  Reach along_[3];
  std::size_t tangent_count_ = 0;
  Tangent tangents_[4];
};

// slices[k], k = 0 ... planes.size(): a box around the part of the hull between planes[k - 1] and planes[k], both
// included; empty if it has none. Planes ascend. The same ball twice: a ball's own slices.
inline void slice_segment(const Ball& first, const Ball& last, int axis, std::span<const float> planes,
                          Box4* slices) noexcept {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const SegmentSlicer slicer(first, last, axis);
  double low = -kInfinity;
  for (std::size_t k = 0; k <= planes.size(); ++k) {
    const double high = k < planes.size() ? static_cast<double>(planes[k]) : kInfinity;
    slices[k] = slicer.between(low, high);
    low = high;
  }
}

}  // namespace perfect_bvh
