// Decides what becomes of a tree that motion degraded and whose triangles no longer move.
// In: what was remembered of the tree, how many rays are expected in this commit, the machine's calibration.
// Out: whether it is kept or rebuilt, why, and what either was expected to cost. Pure functions.
//
// How long the triangles will rest is unknown. Each commit in the degraded tree costs its rays more than a fresh tree
// would: a rent. A new tree is the purchase that ends it. Buying once the rents paid equal the price costs at most
// twice what the best choice in hindsight does (the ski rental problem; Karlin, Manasse, Rudolph and Sleator 1988,
// "Competitive snoopy caching").
#pragma once

#include <cstddef>
#include <optional>

#include "update/governor.h"

namespace perfect_bvh {

struct RestQuestion {
  std::size_t triangle_count = 0;
  const char* what = "triangles";              // that the mesh is of, as sentences name it
  BuilderKind builder = BuilderKind::kBinned;  // of a new tree
  std::optional<double> rays;                  // expected to meet the mesh's box in this commit; unknown: it is kept
  UpdateHistory history;
};

// Whether rays are expected to lose anything in a tree that was refitted, beside a new one.
[[nodiscard]] bool is_degraded(const UpdateHistory& history, const Calibration& calibration) noexcept;

// Of triangles that did not move in this commit: kKeep or kRebuild.
[[nodiscard]] UpdateDecision decide_at_rest(const RestQuestion& question, const Calibration& calibration);

}  // namespace perfect_bvh
