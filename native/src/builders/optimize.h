// Optimizes a finished tree by reinsertion: removes nodes and inserts them where they enlarge the others least
// (Bittner, Hapala and Havran 2013; parallel search: Meister and Bittner 2018, "Parallel reinsertion for bounding
// volume hierarchy optimization"; lecture, "What a BVH allows").
// In: any tree, the maximum number of passes. Out: the same leaves under a tree whose cost is lower, or the same.
#pragma once

#include <cstdint>

#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

struct OptimizeReport {
  std::uint32_t passes = 0;  // passes done; fewer than allowed if one gained nothing
  std::size_t moved = 0;     // reinsertions
};

OptimizeReport optimize_bvh2(Bvh2& tree, std::uint32_t most_passes, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
