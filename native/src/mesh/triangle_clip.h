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

// slices[k], k = 0 ... planes.size(): a box around the part of the triangle between planes[k - 1] and planes[k], both
// included; empty if it has none. Planes ascend.
inline void slice_triangle(const Vec3f (&corners)[3], int axis, std::span<const float> planes, Box4* slices) noexcept {
  for (std::size_t k = 0; k <= planes.size(); ++k) slices[k] = Box4::empty();
  Float4 points[3];
  float places[3];
  for (int i = 0; i < 3; ++i) {
    points[i] = Float4(corners[i].x, corners[i].y, corners[i].z, 0.0f);
    places[i] = corners[i][axis];
    std::size_t k = 0;
    while (k < planes.size() && places[i] > planes[k]) ++k;
    slices[k].grow(points[i]);
    if (k < planes.size() && places[i] == planes[k]) slices[k + 1].grow(points[i]);
  }
  for (int i = 0; i < 3; ++i) {
    const int next = i == 2 ? 0 : i + 1;
    const bool ascends = places[i] < places[next];
    const int low = ascends ? i : next, high = ascends ? next : i;
    std::size_t k = 0;
    while (k < planes.size() && !(places[low] < planes[k])) ++k;
    if (k == planes.size() || !(planes[k] < places[high])) continue;
    const CrossedEdge edge(points[low], points[high], places[low], places[high]);
    for (; k < planes.size() && planes[k] < places[high]; ++k) {
      const Box4 crossing = edge.crossing(planes[k]);
      slices[k].grow(crossing);
      slices[k + 1].grow(crossing);
    }
  }
}

}  // namespace perfect_bvh
