// Decides what becomes of a tree that motion spoilt and whose triangles have come to rest.
// In: what was remembered of the tree, how many rays are expected in this commit, the machine's calibration.
// Out: whether it is kept or built anew, why, and what either was expected to cost. Pure functions.
//
// How long the triangles will rest nobody knows. Each commit in the spoilt tree costs its rays what they pay beyond a
// fresh one's: a rent, and a new tree is the price of paying it no more. Whoever buys once the rents come to the price
// never pays more than twice what an all-knowing one would (the ski rental; Karlin, Manasse, Rudolph and Sleator 1988,
// "Competitive snoopy caching").
#pragma once

#include <cstddef>
#include <optional>

#include "update/governor.h"

namespace perfect_bvh {

struct RestQuestion {
  std::size_t triangle_count = 0;
  BuilderKind builder = BuilderKind::kBinned;  // of a new tree
  std::optional<double> rays;                  // expected to meet the mesh's box in this commit; unknown: it is kept
  UpdateHistory history;
};

// Whether rays are expected to lose anything in a tree that was refitted, beside a new one.
[[nodiscard]] bool is_spoilt(const UpdateHistory& history, const Calibration& calibration) noexcept;

// Of triangles that did not move in this commit: kKeep or kRebuild.
[[nodiscard]] UpdateDecision decide_at_rest(const RestQuestion& question, const Calibration& calibration);

}  // namespace perfect_bvh
