// Where a line meets a segment of a flat curve: a ribbon that faces every ray. Scalar, in double precision, and the
// only judge, as math/round_segment.h is of round curves.
//
// The ribbon. Of all points of a curve's axis, take that which the line comes nearest to: c(s) = c0 + s (c1 - c0), on
// one of the segments. The line meets the ribbon if it passes c(s) no farther than the radius r(s) = r0 + s (r1 - r0),
// and does so where it is nearest to c(s). So the ribbon is the strip through the axis, turned to the ray, as wide as
// the curve; on the outer side of a bend a sector of a disc fills the wedge between two segments, and on the inner side
// they meet in a mitre. At the curve's own ends it is cut off straight: there is no ribbon where the line would come
// nearer to the axis if that were longer.
//
// A segment looks no farther than its neighbours: its part of the axis is the nearest if the line passes neither of the
// two nearer, nor as near to the one with the smaller number. So where a curve crosses itself, or is bent so tightly
// that other segments overlap, each is met. And no line passes between two segments: each distance is computed in one
// way, whoever asks, and one of them is the least.
//
// How exact it is; u = 2^-53, D the distance from the ray's origin to the balls. The line is taken relative to both
// centres, where it is nearest to each: these two vectors across the line are off by a few u D, and all that follows by
// a few u of their own length. So the answer is that of balls which are moved by a few u D. A line all but along the
// axis sees the axis as short as such a move: s, and with it t and the radius, may then be those of any place on it.
// t is never off by more than the segment's own depth, nor is the ray's point at t outside of the ball of s.
#pragma once

#include "math/round_segment.h"

namespace perfect_bvh {

// Where a line comes nearest to an axis.
struct RibbonPlace {
  double t;
  double u;                   // along the segment, 0 to 1
  double away[3];             // from the axis to the line
  double squared;             // of the distance
  bool is_before, is_beyond;  // the nearest point of the axis, were it longer, would be before its first end, or beyond
};

static inline RibbonPlace place_on_ribbon(const RoundRay& ray, const RoundBall& first, const RoundBall& last) noexcept {
  const NearestToCentre at_first = nearest_to_centre(ray, first), at_last = nearest_to_centre(ray, last);
  double step[3];
  for (int i = 0; i < 3; ++i) step[i] = at_last.point[i] - at_first.point[i];
  const double along = -dot_of(at_first.point, step), length = dot_of(step, step);
  RibbonPlace place;
  place.is_before = along < 0.0;
  place.is_beyond = along > length;
  // A line along the axis is as near to all of it: it meets the end that comes first.
  const double end = at_last.t < at_first.t ? 1.0 : 0.0;
  const double inside = length > 0.0 ? smaller(along / length, 1.0) : end;
  place.u = place.is_before ? 0.0 : place.is_beyond ? 1.0 : inside;
  const double between = fused(place.u, at_last.t - at_first.t, at_first.t);
  place.t = place.u == 1.0 ? at_last.t : between;
  for (int i = 0; i < 3; ++i) {
    place.away[i] = place.u == 1.0 ? at_last.point[i] : fused(place.u, step[i], at_first.point[i]);
  }
  place.squared = dot_of(place.away, place.away);
  return place;
}

static inline double radius_at(const RoundBall& first, const RoundBall& last, double u) noexcept {
  return u == 1.0 ? last.radius : fused(u, last.radius - first.radius, first.radius);
}

// A chord of no length, if no neighbour is nearer.
static inline Chord chord_of_ribbon(const RoundRay& ray, const RoundBall& first, const RoundBall& last,
                                    SegmentCode code) noexcept {
  const RibbonPlace place = place_on_ribbon(ray, first, last);
  const double radius = radius_at(first, last, place.u);
  const bool is_cut =
      (place.is_before && (code & kSegmentBefore) == 0) || (place.is_beyond && (code & kSegmentAfter) == 0);
  if (is_cut || !(place.squared <= radius * radius)) return kNoChord;
  return {place.t, place.t};
}

// Which way a ribbon shows itself to face: round, as if it were the curve's surface. `tangent`: along the curve;
// `side`: from the axis towards where the line passes, at so large a `share` of the radius. All in one space.
static inline void ribbon_normal(const double direction[3], const double tangent[3], const double side[3], double share,
                                 double normal[3]) noexcept {
  double across[3], out[3];
  cross_of(tangent, direction, across);
  cross_of(across, tangent, out);  // along the direction, without what is along the curve
  const double width = __builtin_sqrt(dot_of(across, across)), depth = __builtin_sqrt(dot_of(out, out));
  const double sine = width > 0.0 ? smaller(share, 1.0) : 0.0, cosine = __builtin_sqrt(1.0 - sine * sine);
  const double length = __builtin_sqrt(dot_of(direction, direction));
  const double turn = width > 0.0 ? __builtin_copysign(sine, dot_of(across, side)) / width : 0.0;
  for (int i = 0; i < 3; ++i) {
    const double back = depth > 0.0 ? out[i] / depth : direction[i] / length;
    normal[i] = fused(turn, across[i], -(cosine * back));
  }
}

}  // namespace perfect_bvh
