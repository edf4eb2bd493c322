// Optimising a finished tree by reinsertion: nodes are taken out and put where they enlarge the others least (Bittner,
// Hapala and Havran 2013; parallel search: Meister and Bittner 2018, "Parallel reinsertion for bounding volume
// hierarchy optimization"; lecture, "What a BVH allows").
// In: any tree, how many passes at most. Out: the same leaves under a tree of lower cost; never of a higher one.
#pragma once

#include <cstdint>

#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

struct OptimizeReport {
  std::uint32_t passes = 0;  // that ran; fewer than allowed if one found nothing to gain
  std::size_t moved = 0;     // reinsertions
};

OptimizeReport optimize_bvh2(Bvh2& tree, std::uint32_t most_passes, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
