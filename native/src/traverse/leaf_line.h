// A ray as the filter of a leaf of curves or points has it: in the leaf's steps, from the leaf's corner.
#pragma once

#include "wide/wide_bvh.h"

namespace perfect_bvh {

struct alignas(16) LeafLine {
  float nearest[4];              // the line's point nearest to the corner, from there; the fourth means nothing
  float direction[4];            // the ray's
  float least, most;             // hits are between these depths: the direction times the way from that point
  float away;                    // largest component of that point
  float squared_length, length;  // of the direction
  float slack;                   // what double does to the ray, and underflow
};

}  // namespace perfect_bvh
