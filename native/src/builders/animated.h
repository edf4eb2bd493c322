// One topology for a whole animation (Bittner and Meister 2015, "T-SAH: Animation optimized bounding volume
// hierarchies"; lecture, "Refitting": which keeps the topology, so that it should suit all frames): reinsertion as in
// optimize.h, but by the surfaces that nodes have at several moments together.
// In: a tree over the shape at one moment, and all of its primitives' boxes at each. Out: the same leaves under a
// tree that, refitted to any of the moments, is expected to cost the mean ray least. The same for any number of
// threads.
#pragma once

#include <cstdint>

#include "builders/bvh2.h"
#include "builders/optimize.h"
#include "builders/sampled_tree.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// Boxes of the tree stay those of the moment that it was built for. Throws InvalidArgument if the tree cannot be
// refitted, Cancelled, bad_alloc.
OptimizeReport optimize_over_samples(Bvh2& tree, const SampledBoxes& boxes, std::uint32_t passes, ThreadPool& pool,
                                     CancelToken& cancel);

}  // namespace perfect_bvh
