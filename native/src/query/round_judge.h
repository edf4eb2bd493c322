// A mesh's curves or points as formulas take them, in the mesh's own scale.
#pragma once

#include <array>
#include <cstdint>
#include <ranges>

#include "math/curve_joint.h"
#include "mesh/mesh.h"
#include "tlas/instance.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// moment: of a mesh that moves within the shutter.
[[nodiscard]] inline RoundList round_list(const Mesh& mesh, const Moment& moment = {}) noexcept {
  RoundList list{mesh.at_step(moment.step).balls.data(), mesh.segments.data(), 1.0f, mesh.shape};
  list.closed = mesh.closed.data(), list.closed_count = mesh.closed.size();
  if (moment.is_between()) list.later = mesh.at_step(moment.step + 1).balls.data(), list.moment = moment;
  return list;
}

// Ribbon judge --------------------------------------------------------------------------------------------------------
// Whether and where a ray meets a segment of a ribbon, when rounding is taken for no answer (query/round_judge.h): of
// all ribbons whose balls are moved across the ray by no more than a margin.

struct JudgedRibbon {
  bool is_possible, is_sure;  // that it is met, if no neighbour is nearer
  double least, most;         // t
  double nearest, farthest;   // of the distances that the ray may pass the segment's axis at
};

[[nodiscard]] JudgedRibbon judge_ribbon(const RoundRay& ray, const RoundEnds& ends, SegmentCode code,
                                        double margin) noexcept;

// Round judge ---------------------------------------------------------------------------------------------------------
// Whether and where a ray meets a segment of a curve or a point, when rounding is taken for no answer: the judge of
// answers (query/audit.h). A hull whose balls are a margin larger is surely missed or may be hit; one whose balls are a
// margin smaller is surely hit. The margin is far more than kernels are off by, which decide in double precision.

// Where a ray enters or leaves; of a ribbon, whose exit is surely missed, where it meets it. An end that a neighbour
// surely hides is surely missed. Of a chord that is surely there, if a neighbour hides its entry, then that neighbour's
// entry is a surface no later, or that of the next: so a surface is surely there from `least` to `most`, between the
// least of those entries and the chord's own; likewise for exits.
struct JudgedEnd {
  bool surely_missed, surely_hit, is_entry;
  double t, bound;  // an answer's t differs by no more than the bound
  double least, most;
};

class RoundJudge {
 public:
  // Of an instance of curves or points, which must stay where it is. reach: of its mesh, the largest |coordinate|.
  RoundJudge(const Instance& instance, const Ray& ray, double reach) noexcept;

  [[nodiscard]] std::array<JudgedEnd, 2> ends(std::uint32_t primitive) const noexcept;

 private:
  // Of what surely is inside, and of what may be.
  struct JudgedChord {
    Chord sure, possible;
  };
  [[nodiscard]] JudgedChord chord_of(std::uint32_t primitive) const noexcept;
  [[nodiscard]] JudgedRibbon ribbon_of(std::uint32_t primitive) const noexcept;
  // Of a ribbon: where it, or a neighbour that may be nearer, is met.
  [[nodiscard]] JudgedEnd meeting_of(std::uint32_t primitive) const noexcept;
  [[nodiscard]] static JudgedEnd end_of(const JudgedChord& chord, bool is_entry) noexcept;
  // The primitive that comes after, or before if `step` is -1, along its curve, or kNoSegment; and its chord or none.
  [[nodiscard]] std::uint32_t next(std::uint32_t primitive, int step) const noexcept;
  [[nodiscard]] JudgedChord beside(std::uint32_t primitive, int step) const noexcept;
  static void judge_beside(const JudgedChord& other, JudgedEnd& end) noexcept;
  void reach_along(std::uint32_t primitive, int step, JudgedEnd& end) const noexcept;

  const Mesh& mesh_;
  RoundList list_;
  RoundRay ray_;
  double margin_;
};

// The segments of the curve, or the point, that the caller knows by this number: none if there is no such curve.
[[nodiscard]] std::ranges::iota_view<std::uint32_t, std::uint32_t> primitives_of(const Mesh& mesh,
                                                                                 std::int32_t number) noexcept;

}  // namespace perfect_bvh
