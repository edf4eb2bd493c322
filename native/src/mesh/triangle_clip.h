// Cuts a triangle by parallel axis-aligned planes: a box for each slice, as spatial splits need them.
//
// The boxes are conservative, for it is on them that no hit is lost (math/slab.h): a point of the triangle may lie in
// any one of its slices, but in one it must lie. A slice is the convex hull of the corners between its planes and the
// points where edges cross them. With u = 2^-24, a crossing a (1 - t) + b t, t computed in double and narrowed, is
// within 8 u M of the exact one, M the larger of |a| and |b| on that axis (t: u; 1 - t: u; products: u each; sum: u;
// each at most M). It is widened by 16 u M and the smallest normal number, which also covers its own rounding and
// underflow; then it is cut back to the edge's box, where the exact point lies. So faces and edges parallel to an axis
// keep boxes without thickness. Nothing overflows: neither t nor 1 - t exceeds 1.
#pragma once

#include <cstddef>
#include <span>
#include <utility>

#include "math/float4.h"
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

  // Contains the point where the edge meets the plane; the plane is strictly between its ends.
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

  // Around the corners on a plane through the lowest or the highest one; empty if there are none.
  [[nodiscard]] Box4 on_plane(float place) const noexcept {
    Box4 box = Box4::empty();
    if (low_place == place) box.grow(low);
    if (middle_place == place) box.grow(middle);
    if (high_place == place) box.grow(high);
    return box;
  }
};

// slices[k], k = 0 ... planes.size(): a box around the part of the triangle abc between planes[k - 1] and planes[k],
// both included; empty if it has none. Planes ascend.
inline void slice_triangle(const Vec3f& a, const Vec3f& b, const Vec3f& c, int axis, std::span<const float> planes,
                           Box4* slices) noexcept {
  const SortedCorners corners(a, b, c, axis);
  std::size_t k = 0;
  for (; k < planes.size() && planes[k] <= corners.low_place; ++k) slices[k] = corners.on_plane(planes[k]);
  Box4 box{corners.low, corners.low};  // what the slice has of the plane before it, and of corners
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

}  // namespace perfect_bvh
