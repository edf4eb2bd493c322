// Decides which ends of a segment's chord are on the curve's surface, and which are inside the segment before or after
// it. A curve is the union of its segments, and consecutive segments overlap (math/round_segment.h). Without this test,
// a ray would hit surfaces inside the curve at every joint.
//
// An end is hidden if a neighbour's chord contains it. Of two ends at the same t, that of the segment with the smaller
// number is visible. Only neighbours hide ends: if a curve crosses itself, or bends so tightly that other segments
// overlap, their surfaces are hit inside each other, as for two curves.
//
// So the first entry along a ray is always visible, and so is the last exit: an end with the least t is only hidden by
// one with the same t and a smaller number. If only neighbours overlap, the visible ends are those of the chords'
// union: entries and exits alternate.
//
// A cyclic curve's last segment and its first one are neighbours; the first one still has the smaller number. If a
// segment's two spheres are equal at the ray's moment, the segments on both sides of it are neighbours too.
//
// Ribbons have no inside. They are visible where no neighbour's axis is nearer to the line (math/round_segment.h).
#pragma once

#include "math/round_segment.h"
#include "math/turning.h"

namespace perfect_bvh {

struct ShownEnds {
  bool entry, exit;
};

// `other`: the chord of a neighbour, kNoChord if there is none or the ray misses it. `is_before`: the neighbour has the
// smaller number.
static inline ShownEnds shown_beside(const Chord& chord, const Chord& other, bool is_before) noexcept {
  const bool enters_first = other.entry < chord.entry || (other.entry == chord.entry && is_before);
  const bool leaves_last = other.exit > chord.exit || (other.exit == chord.exit && is_before);
  return {!(enters_first && chord.entry <= other.exit), !(leaves_last && other.entry <= chord.exit)};
}

// The primitives of a mesh of curves or points.
struct RoundList {
  const Ball* balls = nullptr;
  const SegmentCode* segments = nullptr;  // null: the primitives are the spheres
  float scale = 1.0f;                     // the scale of the result: the tree's
  CurveShape shape = CurveShape::kRound;
  // For motion within the shutter: the spheres of the next step, and the moment. Null if nothing is interpolated.
  const Ball* later = nullptr;
  Moment moment{};
  const ClosedCurve* closed = nullptr;  // by number; no segment is in two of them
  std::size_t closed_count = 0;
};

// Returns one of the list's spheres at its moment, as a kernel's box contains it then.
static inline RoundBall ball_at(const RoundList& list, std::uint32_t number) noexcept {
  const Ball& from = list.balls[number];
  if (list.later == nullptr) return round_ball(from, list.scale);
  const Ball& to = list.later[number];
  const Moment& moment = list.moment;
  const Ball ball{{interpolate(moment, from.centre.x, to.centre.x), interpolate(moment, from.centre.y, to.centre.y),
                   interpolate(moment, from.centre.z, to.centre.z)},
                  interpolate(moment, from.radius, to.radius)};
  return round_ball(ball, list.scale);
}

// A primitive's two spheres; those of a point are the same.
struct RoundEnds {
  RoundBall first, last;
};

static inline RoundEnds ends_of(const RoundList& list, std::uint32_t primitive) noexcept {
  if (list.segments == nullptr) {
    const RoundBall ball = ball_at(list, primitive);
    return {ball, ball};
  }
  const std::uint32_t first = list.segments[primitive] & kSegmentBall;
  return {ball_at(list, first), ball_at(list, first + 1)};
}

inline constexpr std::uint32_t kNoSegment = 0xFFFFFFFFu;
enum class Along : std::uint8_t { kBefore, kAfter };
static constexpr Along kBothWays[] = {Along::kBefore, Along::kAfter};

static inline std::uint32_t beside(const RoundList& list, std::uint32_t segment, Along way) noexcept {
  if ((list.segments[segment] & (way == Along::kBefore ? kSegmentBefore : kSegmentAfter)) == 0) return kNoSegment;
  std::size_t low = 0;  // the first closed curve that does not end before the segment
  for (std::size_t high = list.closed_count; low < high;) {
    const std::size_t middle = (low + high) / 2;
    list.closed[middle].last < segment ? low = middle + 1 : high = middle;
  }
  if (low < list.closed_count) {
    const ClosedCurve& curve = list.closed[low];
    if (way == Along::kBefore && segment == curve.first) return curve.last;
    if (way == Along::kAfter && segment == curve.last) return curve.first;
  }
  return way == Along::kBefore ? segment - 1 : segment + 1;
}

static inline bool is_one_ball(const RoundEnds& ends) noexcept {
  const RoundBall &a = ends.first, &b = ends.last;
  return a.centre[0] == b.centre[0] && a.centre[1] == b.centre[1] && a.centre[2] == b.centre[2] && a.radius == b.radius;
}

// Returns the next segment after `other` that may hide a segment on this side. kNoSegment if `other` is the last one,
// because it is more than a sphere.
static inline std::uint32_t beyond(const RoundList& list, std::uint32_t segment, std::uint32_t other,
                                   Along way) noexcept {
  const std::uint32_t next = is_one_ball(ends_of(list, other)) ? beside(list, other, way) : kNoSegment;
  return next == segment ? kNoSegment : next;
}

// Returns the next segment along its curve that is more than a sphere; kNoSegment if there is no other.
static inline std::uint32_t neighbour_of(const RoundList& list, std::uint32_t segment, Along way) noexcept {
  std::uint32_t other = beside(list, segment, way);
  while (other != kNoSegment && is_one_ball(ends_of(list, other))) other = beyond(list, segment, other, way);
  return other;
}

static inline Chord chord_of(const RoundRay& ray, const RoundList& list, std::uint32_t primitive) noexcept {
  if (list.segments == nullptr) return chord_of_ball(ray, ball_at(list, primitive));
  const RoundEnds ends = ends_of(list, primitive);
  if (list.shape == CurveShape::kRibbon) {
    return chord_of_ribbon(ray, ends.first, ends.last, list.segments[primitive]);
  }
  return chord_of_segment(ray, ends.first, ends.last);
}

// A segment's neighbour: the sphere that they share, and the vector from its centre to that of the neighbour's other
// sphere.
struct Neighbour {
  RoundBall joint;
  double axis[3];
  double radius;  // the larger one

  Neighbour(const RoundBall& shared, const RoundBall& other) noexcept
      : joint(shared), radius(larger(shared.radius, other.radius)) {
    for (int i = 0; i < 3; ++i) axis[i] = other.centre[i] - shared.centre[i];
  }
};

// Returns true if the neighbour's hull surely contains neither end of a chord: both are farther behind the joint than
// its larger sphere reaches, as usual except near joints. The margin is far more than any rounding (2^-39 of the ray's
// distance). The squared limit is at least the square of radius plus margin.
static inline bool is_behind(const RoundRay& ray, const Chord& chord, const Neighbour& neighbour) noexcept {
  double from_joint[3], point[3];
  for (int i = 0; i < 3; ++i) from_joint[i] = ray.origin[i] - neighbour.joint.centre[i];
  const double reach = 2.001 * (neighbour.radius * neighbour.radius) + 0x1p-78 * dot_of(from_joint, from_joint);
  const double limit = reach * dot_of(neighbour.axis, neighbour.axis);
  const auto is_point_behind = [&](double t) {
    for (int i = 0; i < 3; ++i) point[i] = fused(t, ray.direction[i], from_joint[i]);
    const double along = dot_of(point, neighbour.axis);
    return along < 0.0 && along * along > limit;
  };
  return is_point_behind(chord.entry) && is_point_behind(chord.exit);
}

// Compares a ribbon's segment with the adjacent ones.
static inline bool is_nearest(const RoundRay& ray, const RoundList& list, std::uint32_t primitive) noexcept {
  const auto squared = [&](std::uint32_t number) {
    const RoundEnds ends = ends_of(list, number);
    return place_on_ribbon(ray, ends.first, ends.last).squared;
  };
  const double own = squared(primitive);
  for (const Along way : kBothWays) {
    for (std::uint32_t other = beside(list, primitive, way); other != kNoSegment;) {
      const double others = squared(other);
      if (!(own < others || (own == others && primitive < other))) return false;
      other = beyond(list, primitive, other, way);
    }
  }
  return true;
}

// Returns which ends of its chord a ray hits.
static inline ShownEnds shown_ends(const RoundRay& ray, const RoundList& list, std::uint32_t primitive,
                                   const Chord& chord) noexcept {
  if (list.segments == nullptr) return {true, true};
  if (list.shape == CurveShape::kRibbon) return {is_nearest(ray, list, primitive), false};
  ShownEnds shows{true, true};
  for (const Along way : kBothWays) {
    for (std::uint32_t other = beside(list, primitive, way); other != kNoSegment;) {
      const auto [first, last] = ends_of(list, other);
      const Neighbour neighbour = way == Along::kBefore ? Neighbour(last, first) : Neighbour(first, last);
      if (!is_behind(ray, chord, neighbour)) {
        const ShownEnds beside_it = shown_beside(chord, chord_of_segment(ray, first, last), other < primitive);
        shows = {shows.entry && beside_it.entry, shows.exit && beside_it.exit};
      }
      other = beyond(list, primitive, other, way);
    }
  }
  return shows;
}

// Returns the position along the segment, as a share of its length, where a ray hits it at an end of its chord.
static inline double share_of(const RoundRay& ray, const RoundList& list, std::uint32_t primitive, double t) noexcept {
  if (list.segments == nullptr) return 0.0;
  const RoundEnds ends = ends_of(list, primitive);
  if (list.shape == CurveShape::kRibbon) return place_on_ribbon(ray, ends.first, ends.last).u;
  return share_at(ray, ends.first, ends.last, t);
}

}  // namespace perfect_bvh
