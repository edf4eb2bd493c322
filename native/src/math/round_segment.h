// The elements of curves and points: a point is a sphere, and a curve's segment is the convex hull of two spheres.
#pragma once

#include <cstdint>

#include "math/aabb.h"
#include "math/triangle.h"
#include "math/vec3.h"

namespace perfect_bvh {

struct alignas(16) Ball {
  Vec3f centre;
  float radius;  // not negative
};
static_assert(sizeof(Ball) == 16);

// Returns a box that contains the sphere. With u = 2^-24 a sum s of two floats is within u |s| of the exact one, and
// exact if it is subnormal. s 2^-23 is at least the distance from s to the next float, and s shifted by that is rounded
// to that float or beyond.
[[nodiscard]] static inline Aabb box_of(const Ball& ball) noexcept {
  Aabb box;
  for (int axis = 0; axis < 3; ++axis) {
    const float lower = ball.centre[axis] - ball.radius, upper = ball.centre[axis] + ball.radius;
    box.lower[axis] = lower - (lower < 0.0f ? -lower : lower) * 0x1p-23f;
    box.upper[axis] = upper + (upper < 0.0f ? -upper : upper) * 0x1p-23f;
  }
  return box;
}

// A curve's segment: the number of its first sphere (the second sphere is the next one), and whether the same curve has
// another segment after it, with the next number, or before it.
using SegmentCode = std::uint32_t;
inline constexpr SegmentCode kSegmentBall = 0x3FFFFFFFu, kSegmentAfter = 0x40000000u, kSegmentBefore = 0x80000000u;

// A cyclic curve's first and last segment, which are neighbours.
struct ClosedCurve {
  std::uint32_t first, last;
};

// The shape of curves for rays: the hull of their spheres, or flat and always turned to the ray (math/round_segment.h).
enum class CurveShape : std::uint8_t { kRound, kRibbon };

// Round segment -------------------------------------------------------------------------------------------------------
// Intersects a line with a segment of a curve: the convex hull of two spheres. Scalar, in double precision. Only this
// decides: kernels use float to select the segments that it tests.
//
// The hull is bounded by parts of its spheres and, between the circles where a cone touches both, by that cone. It is
// convex, so the part of a line inside it, its chord, goes from the first to the last of the points where the line
// passes through one of the spheres or that part of the cone. A sphere's chord is a function of only the line and that
// sphere, and the computed chord of the hull always contains it. So two segments that share a sphere overlap in at
// least its chord, and no line passes between them.
//
// The cone. With a = c1 - c0, d = r1 - r0 and H = a.a - d d (positive, unless one sphere contains the other: then the
// hull is that sphere), the point c(s) = c0 + s a of the axis is the centre of a sphere of radius r(s) = r0 + s d. It
// touches the cone in a circle. s is linear along any line: s = ((p - c0).a + r0 d) / H for a point p of the cone. p is
// on the cone if |(p - c0) x a|^2 = H r(s)^2, and on the part that bounds the hull if s is from 0 to 1.
//
// Precision; u = 2^-53, D the distance from the ray's origin to the spheres, R the larger radius. Quadratic equations
// are set up where the line is nearest to the sphere's centre, or to the axis between its ends, not at the origin. None
// of their terms is much larger than R^2 (times H) there, so rounding them moves the surface by a few u R. The
// products' errors are recovered in cross products and the discriminant. The remaining error is that of moving the
// origin there: a few u D. So hits are off the surface by less than 1e-4 R for D up to 1e11 R. Near a tip (a sphere of
// radius 0), rounding the terms can move the cone by 2^-24 R, where r(s) is as small as that.
//
// No case is distinguished by how small a value is:
// - The line runs along the axis (e = 0, or only its rounding error): a cylinder's quadratic has no roots, or roots far
//   away whose s is out of range. The spheres have the ends of the chord.
// - A sphere contains the other, or both are equal: H is not positive, and the spheres have the whole chord. If
//   rounding makes H positive, or a positive H 0, the part of the cone on the hull is within u R of the larger sphere.
// - A tip: its sphere's chord is empty, or has no length if the line passes through the computed centre.
// - A tangent line: it may hit or miss if the hull's surface is within a few u (D + R) of it.

struct RoundRay {
  double origin[3], direction[3];
  double squared_length;  // of the direction
};

// Inlined: GCC would call it, a dozen times for each tested segment.
__attribute__((always_inline)) static inline double dot_of(const double a[3], const double b[3]) noexcept {
  return fused(a[2], b[2], fused(a[1], b[1], a[0] * b[0]));
}

static inline RoundRay round_ray(const double origin[3], const double direction[3]) noexcept {
  RoundRay ray;
  for (int i = 0; i < 3; ++i) ray.origin[i] = origin[i], ray.direction[i] = direction[i];
  ray.squared_length = dot_of(direction, direction);
  return ray;
}

// A sphere in the tree's scale.
struct RoundBall {
  double centre[3];
  double radius;
};

static inline RoundBall round_ball(const Ball& ball, float scale) noexcept {
  return {{static_cast<double>(ball.centre.x * scale), static_cast<double>(ball.centre.y * scale),
           static_cast<double>(ball.centre.z * scale)},
          static_cast<double>(ball.radius * scale)};
}

// The part of a line inside a primitive, as t of the ray, which may be negative. If the line misses it, entry is plus
// infinity and exit is minus infinity.
struct Chord {
  double entry, exit;
};
static constexpr Chord kNoChord = {__builtin_inf(), -__builtin_inf()};
static inline bool is_hit(const Chord& chord) noexcept { return chord.entry <= chord.exit; }

// The point of a line nearest to a sphere's centre: its t, and the point relative to the centre.
struct NearestToCentre {
  double t;
  double point[3];
};

static inline NearestToCentre nearest_to_centre(const RoundRay& ray, const RoundBall& ball) noexcept {
  double to_centre[3];
  for (int i = 0; i < 3; ++i) to_centre[i] = ball.centre[i] - ray.origin[i];
  NearestToCentre nearest;
  nearest.t = dot_of(to_centre, ray.direction) / ray.squared_length;
  for (int i = 0; i < 3; ++i) nearest.point[i] = fused(nearest.t, ray.direction[i], -to_centre[i]);
  return nearest;
}

static inline Chord chord_of_ball(const RoundRay& ray, const RoundBall& ball, const NearestToCentre& nearest) noexcept {
  const double inside = ball.radius * ball.radius - dot_of(nearest.point, nearest.point);
  if (!(inside >= 0.0)) return kNoChord;
  const double half = __builtin_sqrt(inside / ray.squared_length);
  return {nearest.t - half, nearest.t + half};
}

static inline Chord chord_of_ball(const RoundRay& ray, const RoundBall& ball) noexcept {
  return chord_of_ball(ray, ball, nearest_to_centre(ray, ball));
}

static inline Chord united(const Chord& a, const Chord& b) noexcept {
  return {smaller(a.entry, b.entry), larger(a.exit, b.exit)};
}

static inline void cross_of(const double a[3], const double b[3], double out[3]) noexcept {
  out[0] = product_difference(a[1], b[2], a[2], b[1]);
  out[1] = product_difference(a[2], b[0], a[0], b[2]);
  out[2] = product_difference(a[0], b[1], a[1], b[0]);
}

// The cone that touches two spheres.
struct RoundCone {
  double axis[3];    // a
  double widening;   // d
  double squared;    // H: squared length of a tangent between the circles where it touches; no cone unless positive
  double at_centre;  // r0 d: s H at c0
};

static inline RoundCone cone_of(const RoundBall& first, const RoundBall& last) noexcept {
  RoundCone cone;
  for (int i = 0; i < 3; ++i) cone.axis[i] = last.centre[i] - first.centre[i];
  cone.widening = last.radius - first.radius;
  cone.squared = dot_of(cone.axis, cone.axis) - cone.widening * cone.widening;
  cone.at_centre = first.radius * cone.widening;
  return cone;
}

// Returns the distance in t from the point nearest to the first centre to where the line is nearest to the axis between
// s = 0 and 1. If it is nearest to an end, that end counts. s starts at s_here, and grows by s_rate in t.
static inline double nearest_to_axis(const double from_axis[3], const double away[3], double s_here,
                                     double s_rate) noexcept {
  const double nearest = -dot_of(from_axis, away) / dot_of(away, away);
  if (s_rate == 0.0) return nearest;  // across the axis
  const double at_first = -s_here / s_rate, at_last = (1.0 - s_here) / s_rate;
  const double least = smaller(at_first, at_last), most = larger(at_first, at_last);
  return nearest > least ? smaller(nearest, most) : least;  // also along the axis, where `nearest` is NaN
}

// Returns the points where the line passes through the part of the cone that bounds the hull. `nearest`: to the first
// sphere.
static inline Chord chord_of_cone(const RoundRay& ray, const RoundBall& first, const RoundCone& cone,
                                  const NearestToCentre& nearest) noexcept {
  double away[3], from_axis[3], point[3];
  cross_of(ray.direction, cone.axis, away);
  cross_of(nearest.point, cone.axis, from_axis);
  const double s_rate = dot_of(ray.direction, cone.axis) / cone.squared;
  const double s_at_ball = (dot_of(nearest.point, cone.axis) + cone.at_centre) / cone.squared;
  const double beyond = nearest_to_axis(from_axis, away, s_at_ball, s_rate);
  for (int i = 0; i < 3; ++i) point[i] = fused(beyond, ray.direction[i], nearest.point[i]);
  cross_of(point, cone.axis, from_axis);
  const double s_here = (dot_of(point, cone.axis) + cone.at_centre) / cone.squared;
  // a t^2 + 2 b t + c = 0, with t relative to this point.
  const double radius = fused(s_here, cone.widening, first.radius), radius_rate = s_rate * cone.widening;
  const double a = dot_of(away, away) - cone.squared * (radius_rate * radius_rate);
  const double b = dot_of(from_axis, away) - cone.squared * (radius * radius_rate);
  const double c = dot_of(from_axis, from_axis) - cone.squared * (radius * radius);
  const double discriminant = product_difference(b, b, a, c);
  if (!(discriminant >= 0.0)) return kNoChord;
  const double sum = -(b + __builtin_copysign(__builtin_sqrt(discriminant), b));
  const double roots[2] = {sum / a, c / sum};  // not finite if there is none: then s is out of range or NaN
  Chord chord = kNoChord;
  for (const double root : roots) {
    const double s = fused(root, s_rate, s_here);
    if (!(s >= 0.0 && s <= 1.0)) continue;
    const double t = nearest.t + (beyond + root);
    chord = united(chord, {t, t});
  }
  return chord;
}

static inline Chord chord_of_segment(const RoundRay& ray, const RoundBall& first, const RoundBall& last) noexcept {
  const NearestToCentre nearest = nearest_to_centre(ray, first);
  const Chord balls = united(chord_of_ball(ray, first, nearest), chord_of_ball(ray, last));
  const RoundCone cone = cone_of(first, last);
  return cone.squared > 0.0 ? united(balls, chord_of_cone(ray, first, cone, nearest)) : balls;
}

// Returns the position on the axis for a point of a segment's surface: the share s of the sphere that touches the hull
// there, 0 for the first sphere, 1 for the last. `point`: relative to the first centre.
static inline double share_at(const RoundCone& cone, const double point[3]) noexcept {
  if (!(cone.squared > 0.0)) return cone.widening > 0.0 ? 1.0 : 0.0;
  const double s = (dot_of(point, cone.axis) + cone.at_centre) / cone.squared;
  return s > 0.0 ? smaller(s, 1.0) : 0.0;
}

// A point of a segment's surface.
struct RoundSurface {
  double u;          // along the segment: the s of the sphere that touches the hull there
  double normal[3];  // outward, of length 1; 0 at a tip
};

// Returns a ray's point relative to a sphere's centre. Computed from the point nearest to it, to be exact from far away
// too.
static inline void point_from(const RoundRay& ray, const RoundBall& ball, double t, double point[3]) noexcept {
  const NearestToCentre nearest = nearest_to_centre(ray, ball);
  for (int i = 0; i < 3; ++i) point[i] = fused(t - nearest.t, ray.direction[i], nearest.point[i]);
}

static inline double share_at(const RoundRay& ray, const RoundBall& first, const RoundBall& last, double t) noexcept {
  double point[3];
  point_from(ray, first, t, point);
  return share_at(cone_of(first, last), point);
}

// Returns the surface at t of the ray, an end of its chord.
static inline RoundSurface surface_at(const RoundRay& ray, const RoundBall& first, const RoundBall& last,
                                      double t) noexcept {
  const RoundCone cone = cone_of(first, last);
  double point[3];
  point_from(ray, first, t, point);
  RoundSurface surface;
  surface.u = share_at(cone, point);
  double* const normal = surface.normal;
  for (int i = 0; i < 3; ++i) normal[i] = fused(-surface.u, cone.axis[i], point[i]);
  const double length = __builtin_sqrt(dot_of(normal, normal));
  for (int i = 0; i < 3; ++i) normal[i] = length > 0.0 ? normal[i] / length : 0.0;
  return surface;
}

// Ribbon segment ------------------------------------------------------------------------------------------------------
// Intersects a line with a segment of a flat curve: a ribbon that faces every ray. Scalar, in double precision. Only
// this decides, like math/round_segment.h for round curves.
//
// The ribbon. Let c(s) = c0 + s (c1 - c0), on one of the segments, be the point of a curve's axis nearest to the line.
// The line hits the ribbon if its distance from c(s) is at most the radius r(s) = r0 + s (r1 - r0), and the hit is
// where it is nearest to c(s). So the ribbon is a strip along the axis, turned to the ray, as wide as the curve. On the
// outer side of a bend, a sector of a disc fills the wedge between two segments; on the inner side they meet in a
// mitre. The curve's ends are cut off straight: there is no ribbon where the line would be nearer to the axis if that
// were longer.
//
// A segment is only compared with its neighbours. Its part of the axis is the nearest if neither neighbour is nearer to
// the line, and the one with the smaller number is not equally near. So where a curve crosses itself, or bends so
// tightly that other segments overlap, each is hit. And no line passes between two segments: each distance is always
// computed in the same way, and one of them is the least.
//
// Precision; u = 2^-53, D the distance from the ray's origin to the spheres. The line is taken relative to both
// centres, where it is nearest to each. These two vectors across the line are off by a few u D, and all that derives
// from them by a few u of their length. So the answer is that for spheres moved by a few u D. A line almost along it
// sees the axis as short as such a move; s, and with it t and the radius, may then be those of any point on it. t is
// never off by more than the segment's own depth, and the ray's point at t is never outside the sphere of s.

// The point of an axis nearest to a line.
struct RibbonPlace {
  double t;
  double u;                   // along the segment, 0 to 1
  double away[3];             // from the axis to the line
  double squared;             // the squared distance
  bool is_before, is_beyond;  // if the axis were longer, the nearest point would be before its first end, or beyond
};

static inline RibbonPlace place_on_ribbon(const RoundRay& ray, const RoundBall& first, const RoundBall& last) noexcept {
  const NearestToCentre at_first = nearest_to_centre(ray, first), at_last = nearest_to_centre(ray, last);
  double step[3];
  for (int i = 0; i < 3; ++i) step[i] = at_last.point[i] - at_first.point[i];
  const double along = -dot_of(at_first.point, step), length = dot_of(step, step);
  RibbonPlace place;
  place.is_before = along < 0.0;
  place.is_beyond = along > length;
  // A line along the axis is equally near to all of it: it hits the end that comes first.
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

// Returns a chord of no length if no neighbour is nearer.
static inline Chord chord_of_ribbon(const RoundRay& ray, const RoundBall& first, const RoundBall& last,
                                    SegmentCode code) noexcept {
  const RibbonPlace place = place_on_ribbon(ray, first, last);
  const double radius = radius_at(first, last, place.u);
  const bool is_cut =
      (place.is_before && (code & kSegmentBefore) == 0) || (place.is_beyond && (code & kSegmentAfter) == 0);
  if (is_cut || !(place.squared <= radius * radius)) return kNoChord;
  return {place.t, place.t};
}

// Computes a ribbon's shading normal: round, as if the ribbon were the curve's surface. `tangent`: along the curve.
// `side`: from the axis towards the line, at `share` of the radius. All are in the same space.
static inline void ribbon_normal(const double direction[3], const double tangent[3], const double side[3], double share,
                                 double normal[3]) noexcept {
  double across[3], out[3];
  cross_of(tangent, direction, across);
  cross_of(across, tangent, out);  // the direction, without its part along the curve
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
