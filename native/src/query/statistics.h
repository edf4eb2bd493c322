// Measures a snapshot's trees.
// In: a snapshot, the costs to reckon with. Out: sizes and quality of every mesh's tree and of the top level.
#pragma once

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "stats/scene_statistics.h"
#include "tlas/snapshot.h"

namespace perfect_bvh {

struct StatisticsOptions {
  // EPO and leaf-count variability: microseconds for each triangle, and trees that are no longer kept are built again.
  bool is_detailed = false;
  float traversal_cost = 1.0f;
  float intersection_cost = 1.0f;
};

// Throws Cancelled, bad_alloc. The same numbers for any thread count.
[[nodiscard]] SceneStatistics measure(const Snapshot& snapshot, const StatisticsOptions& options, ThreadPool& pool,
                                      CancelToken& cancel);

}  // namespace perfect_bvh
