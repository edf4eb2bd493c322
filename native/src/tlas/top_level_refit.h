// Refitting the top level: instances that only moved keep their places in the tree, which gets new boxes (lecture,
// "Refitting"). And the measure that tells when another tree would serve better.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "builders/prim_ref.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "tlas/top_level.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

[[nodiscard]] TopLevelCost measure_cost(const WideBvh& wide, ThreadPool& pool, CancelToken& cancel);

// Whether both trees stand over the instances that have a box now. boxes: one a row, empty over nothing.
[[nodiscard]] bool is_over(const Bvh2& tree, std::span<const PrimRef> boxes);

// New boxes and visiting orders for both trees of one top level, which must stand over `boxes`.
void refit_top_level(Bvh2& tree, WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel);

// Whether rays lose no more on a refitted tree than another one costs. `built` was measured when the tree was built.
// Where instances cover less of the whole than they did then, a new tree might be so much better than that one was.
// expected_rays: about to be cast; if nobody says, half a million.
[[nodiscard]] bool is_worth_keeping(const TopLevelCost& now, const TopLevelCost& built, std::size_t instance_count,
                                    std::optional<double> expected_rays);
// What that was decided by, as a clause.
[[nodiscard]] std::string describe(const TopLevelCost& now, const TopLevelCost& built);

}  // namespace perfect_bvh
