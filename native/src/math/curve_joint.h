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
#pragma once

#include "math/round_segment.h"

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
};

// A primitive's two balls; a point's are one.
struct RoundEnds {
  RoundBall first, last;
};

static inline RoundEnds ends_of(const RoundList& list, std::uint32_t primitive) noexcept {
  if (list.segments == nullptr) {
    const RoundBall ball = round_ball(list.balls[primitive], list.scale);
    return {ball, ball};
  }
  const Ball* const first = list.balls + (list.segments[primitive] & kSegmentBall);
  return {round_ball(first[0], list.scale), round_ball(first[1], list.scale)};
}

static inline Chord chord_of(const RoundRay& ray, const RoundList& list, std::uint32_t primitive) noexcept {
  if (list.segments == nullptr) return chord_of_ball(ray, round_ball(list.balls[primitive], list.scale));
  const RoundEnds ends = ends_of(list, primitive);
  return chord_of_segment(ray, ends.first, ends.last);
}

// Which ends of its chord a ray meets.
static inline ShownEnds shown_ends(const RoundRay& ray, const RoundList& list, std::uint32_t primitive,
                                   const Chord& chord) noexcept {
  if (list.segments == nullptr) return {true, true};
  const SegmentCode code = list.segments[primitive];
  const Chord before = (code & kSegmentBefore) != 0 ? chord_of(ray, list, primitive - 1) : kNoChord;
  const Chord after = (code & kSegmentAfter) != 0 ? chord_of(ray, list, primitive + 1) : kNoChord;
  return shown_ends(before, chord, after);
}

}  // namespace perfect_bvh
