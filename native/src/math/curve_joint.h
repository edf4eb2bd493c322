// Which ends of a segment's chord are the curve's surface, and which lie inside of the segment before or after it. A
// curve is the union of its segments, of which consecutive ones overlap (math/round_segment.h): without this a ray
// would meet surfaces inside of the curve at every joint.
//
// An end is hidden if a neighbour's chord holds it; of two ends at the same t, that of the segment with the smaller
// number is shown. Only neighbours hide: where a curve crosses itself, or is bent so tightly that other segments
// overlap, their surfaces are met inside of each other, as those of two curves are.
//
// So what is first entered along a ray is always shown, and what is left last: of the ends with the least t none is
// hidden but by one with the same t and a smaller number. And where no segments but neighbours overlap, the shown ends
// are those of the chords' union: in and out by turns.
//
// Ribbons have no inside, and are shown where no neighbour's axis is nearer to the line (math/ribbon_segment.h).
#pragma once

#include "math/ball.h"
#include "math/ribbon_segment.h"
#include "math/round_segment.h"
#include "math/step_times.h"

namespace perfect_bvh {

struct ShownEnds {
  bool entry, exit;
};

// `other`: of a neighbour, kNoChord if there is none, or the ray misses it; `is_before`: it has the smaller number.
static inline ShownEnds shown_beside(const Chord& chord, const Chord& other, bool is_before) noexcept {
  const bool enters_first = other.entry < chord.entry || (other.entry == chord.entry && is_before);
  const bool leaves_last = other.exit > chord.exit || (other.exit == chord.exit && is_before);
  return {!(enters_first && chord.entry <= other.exit), !(leaves_last && other.entry <= chord.exit)};
}

static inline ShownEnds shown_ends(const Chord& before, const Chord& chord, const Chord& after) noexcept {
  const ShownEnds left = shown_beside(chord, before, true), right = shown_beside(chord, after, false);
  return {left.entry && right.entry, left.exit && right.exit};
}

// The primitives of a mesh of curves or points.
struct RoundList {
  const Ball* balls = nullptr;
  const SegmentCode* segments = nullptr;  // null: the primitives are the balls
  float scale = 1.0f;                     // what the balls are brought to: the tree's
  CurveShape shape = CurveShape::kRound;
  // Of what moves within the shutter: the balls of the next step, and the moment; null where all are as they are.
  const Ball* later = nullptr;
  Moment moment{};
};

// One of the list's balls, at its moment: as a kernel's box has it there.
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

// A primitive's two balls; a point's are one.
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

static inline Chord chord_of(const RoundRay& ray, const RoundList& list, std::uint32_t primitive) noexcept {
  if (list.segments == nullptr) return chord_of_ball(ray, ball_at(list, primitive));
  const RoundEnds ends = ends_of(list, primitive);
  if (list.shape == CurveShape::kRibbon) {
    return chord_of_ribbon(ray, ends.first, ends.last, list.segments[primitive]);
  }
  return chord_of_segment(ray, ends.first, ends.last);
}

// A segment's neighbour: the ball that they share, and the way from its centre to that of the neighbour's other ball.
struct Neighbour {
  RoundBall joint;
  double axis[3];
  double radius;  // the larger one

  Neighbour(const RoundBall& shared, const RoundBall& other) noexcept
      : joint(shared), radius(larger(shared.radius, other.radius)) {
    for (int i = 0; i < 3; ++i) axis[i] = other.centre[i] - shared.centre[i];
  }
};

// True if the neighbour's hull holds neither end of a chord, by far more than any rounding moves it (2^-39 of the ray's
// distance): they lie further behind the joint than its larger ball reaches, as they do but near to joints. What is
// squared is at least the sum of radius and margin.
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

// Of a ribbon's segment and those beside it.
static inline bool is_nearest(const RoundRay& ray, const RoundList& list, std::uint32_t primitive) noexcept {
  const auto squared = [&](std::uint32_t number) {
    const RoundEnds ends = ends_of(list, number);
    return place_on_ribbon(ray, ends.first, ends.last).squared;
  };
  const SegmentCode code = list.segments[primitive];
  const double own = squared(primitive);
  if ((code & kSegmentBefore) != 0 && !(own < squared(primitive - 1))) return false;
  return (code & kSegmentAfter) == 0 || own <= squared(primitive + 1);
}

// Which ends of its chord a ray meets.
static inline ShownEnds shown_ends(const RoundRay& ray, const RoundList& list, std::uint32_t primitive,
                                   const Chord& chord) noexcept {
  if (list.segments == nullptr) return {true, true};
  if (list.shape == CurveShape::kRibbon) return {is_nearest(ray, list, primitive), false};
  const SegmentCode code = list.segments[primitive];
  const std::uint32_t first = code & kSegmentBall;
  const RoundEnds ends = ends_of(list, primitive);
  Chord before = kNoChord, after = kNoChord;
  if ((code & kSegmentBefore) != 0) {
    const RoundBall other = ball_at(list, first - 1);
    if (!is_behind(ray, chord, Neighbour(ends.first, other))) before = chord_of_segment(ray, other, ends.first);
  }
  if ((code & kSegmentAfter) != 0) {
    const RoundBall other = ball_at(list, first + 2);
    if (!is_behind(ray, chord, Neighbour(ends.last, other))) after = chord_of_segment(ray, ends.last, other);
  }
  return shown_ends(before, chord, after);
}

// How far along its segment a ray meets it, at an end of its chord.
static inline double share_of(const RoundRay& ray, const RoundList& list, std::uint32_t primitive, double t) noexcept {
  if (list.segments == nullptr) return 0.0;
  const RoundEnds ends = ends_of(list, primitive);
  if (list.shape == CurveShape::kRibbon) return place_on_ribbon(ray, ends.first, ends.last).u;
  return share_at(ray, ends.first, ends.last, t);
}

}  // namespace perfect_bvh
