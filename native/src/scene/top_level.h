// The tree over a scene's instances.
// In: the world boxes of instances. Out: a Bvh2 with one instance a leaf, the same bytes for any thread count.
#pragma once

#include <span>

#include "build/bvh2.h"
#include "build/prim_ref.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// How many clusters are joined pair by pair: the instances themselves where they are no more, else the parts of a
// binned tree. Measured with 1,000 to 100,000 boxes on one thread: joining takes 1 to 2 us a cluster, more for larger
// numbers, against 0.2 us an instance for the binned tree. Where small instances stand on large ones, 256 clusters
// already give all that the whole would (SAH 2.0 against 7.0 binned), and where all are alike the binned tree is kept
// anyhow (SAH 191 against 224), so that what is spent here in vain has to stay small.
inline constexpr std::uint32_t kMostClusters = 1024;

struct TopLevel {
  Bvh2 tree;
  const char* builder = "";  // "agglomerative", or what made the tree where clustering gained nothing; "" over nothing
  double build_milliseconds = 0, clustering_milliseconds = 0;
};

// Boxes must not be empty or infinite; their numbers need not be rows. Throws Cancelled, bad_alloc.
[[nodiscard]] TopLevel build_top_level(std::span<const PrimRef> prims, ThreadPool& pool, CancelToken& cancel,
                                       std::uint32_t most_clusters = kMostClusters);

}  // namespace perfect_bvh
