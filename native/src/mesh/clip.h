// Cuts a triangle by parallel axis-aligned planes, and returns a box for each slice, for spatial splits.
//
// The boxes are conservative, because they guarantee that no hit is lost (math/slab.h): each point of the triangle must
// be in at least one slice. A slice is the convex hull of the corners between its planes and the points where edges
// cross them. With u = 2^-24, a crossing a (1 - t) + b t, with t computed in double and narrowed, is within 8 u M of
// the exact one, M being the larger of |a| and |b| on that axis (t: u; 1 - t: u; products: u each; sum: u; each at most
// M). It is widened by 16 u M and the smallest normal number, which also covers its own rounding and underflow. Then it
// is clipped to the edge's box, which contains the exact point. So faces and edges parallel to an axis keep boxes
// without thickness. Nothing overflows: neither t nor 1 - t exceeds 1.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>

#include "math/float4.h"
#include "math/round_segment.h"
#include "math/vec3.h"

namespace perfect_bvh {

struct CrossedEdge {
  Float4 from, to, lower, upper, slack;
  double start, per_length;  // along the planes' axis

  CrossedEdge(Float4 a, Float4 b, float a_place, float b_place) noexcept
      : from(a),
        to(b),
        lower(min(a, b)),
        upper(max(a, b)),
        slack(max(upper, Float4(0.0f) - lower) * Float4(0x1p-20f) + Float4(0x1p-126f)),
        start(static_cast<double>(a_place)),
        per_length(1.0 / (static_cast<double>(b_place) - start)) {}

  // Returns a box that contains the point where the edge crosses the plane; the plane is strictly between its ends.
  [[nodiscard]] Box4 crossing(float place) const noexcept {
    const auto t = static_cast<float>((static_cast<double>(place) - start) * per_length);
    const Float4 point = from * Float4(1.0f - t) + to * Float4(t);
    return {max(point - slack, lower), min(point + slack, upper)};
  }
};

// A triangle's corners in ascending order along the planes' axis.
struct SortedCorners {
  Float4 low, middle, high;
  float low_place, middle_place, high_place;

  SortedCorners(const Vec3f& a, const Vec3f& b, const Vec3f& c, int axis) noexcept {
    const Vec3f *first = &a, *second = &b, *third = &c;
    if ((*second)[axis] < (*first)[axis]) std::swap(first, second);
    if ((*third)[axis] < (*second)[axis]) std::swap(second, third);
    if ((*second)[axis] < (*first)[axis]) std::swap(first, second);
    low = load_xyz(first), middle = load_xyz(second), high = load_xyz(third);
    low_place = (*first)[axis], middle_place = (*second)[axis], high_place = (*third)[axis];
  }

  // Returns a box around the corners on a plane through the lowest or the highest one; empty if there are none.
  [[nodiscard]] Box4 on_plane(float place) const noexcept {
    Box4 box = Box4::empty();
    if (low_place == place) box.grow(low);
    if (middle_place == place) box.grow(middle);
    if (high_place == place) box.grow(high);
    return box;
  }
};

// Writes slices[k], k = 0 ... planes.size(): a box around the part of the triangle abc between planes[k - 1] and
// planes[k], both included; empty if there is none. Planes are in ascending order.
inline void slice_triangle(const Vec3f& a, const Vec3f& b, const Vec3f& c, int axis, std::span<const float> planes,
                           Box4* slices) noexcept {
  const SortedCorners corners(a, b, c, axis);
  std::size_t k = 0;
  for (; k < planes.size() && planes[k] <= corners.low_place; ++k) slices[k] = corners.on_plane(planes[k]);
  Box4 box{corners.low, corners.low};  // the slice's points on the plane before it, and its corners
  const auto is_below = [&](float place) { return k < planes.size() && planes[k] < place; };
  const auto cut_at = [&](Box4 crossing, const Box4& other_crossing) {
    crossing.grow(other_crossing);
    box.grow(crossing);
    slices[k++] = box;
    box = crossing;
  };
  if (is_below(corners.high_place)) {
    const CrossedEdge whole(corners.low, corners.high, corners.low_place, corners.high_place);
    if (is_below(corners.middle_place)) {
      const CrossedEdge edge(corners.low, corners.middle, corners.low_place, corners.middle_place);
      while (is_below(corners.middle_place)) cut_at(whole.crossing(planes[k]), edge.crossing(planes[k]));
    }
    box.grow(corners.middle);
    if (is_below(corners.high_place) && planes[k] == corners.middle_place) {
      cut_at(whole.crossing(planes[k]), {corners.middle, corners.middle});
    }
    if (is_below(corners.high_place)) {
      const CrossedEdge edge(corners.middle, corners.high, corners.middle_place, corners.high_place);
      while (is_below(corners.high_place)) cut_at(whole.crossing(planes[k]), edge.crossing(planes[k]));
    }
  } else {
    box.grow(corners.middle);
  }
  box.grow(corners.high);
  slices[k] = box;
  for (; k < planes.size(); ++k) slices[k + 1] = corners.on_plane(planes[k]);
}

// Segment clip --------------------------------------------------------------------------------------------------------
// Cuts a sphere, or the convex hull of two, by parallel axis-aligned planes, and returns a box for each slice, for
// spatial splits, as for triangles above.
//
// The hull is the union of the spheres between its two spheres: centre and radius are interpolated linearly. Points
// between two planes are in the spheres that overlap that interval. The box of consecutive spheres is that of the first
// and the last. A slanted hull's box is also bounded by the tangent planes of its two spheres: in projection along an
// axis, the hull is that of two discs, on one side of both lines that touch both discs. The smaller of the two
// bounds is used. Any line works if its distance from the discs is known, so the rounding of its direction does not
// matter.
//
// The boxes are conservative. Everything is computed in double precision and widened by 2^-22 of the largest coordinate
// M of the hull: 4 units of a float, more than the error of narrowing (half a unit). In double, u = 2^-53, planes are
// ignored if the hull hardly rises towards them (less than 2^-20 M). A share of the spheres is then off by less than
// 8 u M / (2^-20 M) < 2^-29 of the distance between them, which is at most 2 M. A tangent's position is off by less
// than 16 u M / ny, and it is ignored if ny < 2^-20.

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

  // Returns the box of the part between two planes, the first below the second; empty if there is none.
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
  // A number that is interpolated linearly from the first sphere to the last.
  struct Run {
    double from, to;
    [[nodiscard]] double at(double share) const noexcept { return from + share * (to - from); }
  };
  // The extent of the spheres along an axis.
  struct Reach {
    Run lower, upper;
  };
  struct Shares {
    double first, last;
  };
  // Every point of the hull has slope * coordinate[cut axis] + coordinate[across] <= place, or >= if the line is below
  // it.
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

  // Returns the spheres that overlap the interval between the planes; all spheres if that is not precise enough.
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
    if (!(rest > 0)) return;  // one disc contains the other
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

// Writes slices[k], k = 0 ... planes.size(): a box around the part of the hull between planes[k - 1] and planes[k],
// both included; empty if there is none. Planes are in ascending order. If both spheres are the same, cuts it.
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
