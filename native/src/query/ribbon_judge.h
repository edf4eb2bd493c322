// Whether and where a ray meets a segment of a ribbon, when rounding is taken for no answer (query/round_judge.h): of
// all ribbons whose balls are moved across the ray by no more than a margin.
#pragma once

#include "math/curve_joint.h"

namespace perfect_bvh {

struct JudgedRibbon {
  bool is_possible, is_sure;  // that it is met, if no neighbour is nearer
  double least, most;         // t
  double nearest, farthest;   // of the distances that the ray may pass the segment's axis at
};

[[nodiscard]] JudgedRibbon judge_ribbon(const RoundRay& ray, const RoundEnds& ends, SegmentCode code,
                                        double margin) noexcept;

}  // namespace perfect_bvh
