// The tree over a scene's instances.
// In: the world boxes of instances. Out: a Bvh2 with one instance a leaf, the same bytes for any thread count.
//
// Tried, and left out: the builder over Morton clusters in the place of the binned one takes a third fewer instructions
// (with clusters twice as loose as meshes want them), but rays then visit 5 to 8 percent more of this level's nodes.
// Left open: opening large overlapping instances, so that parts of them stand in the tree (Benthin, Woop, Wald and Afra
// 2017, "Improved two-level BVHs using partial re-braiding"). What it could win at most was measured with 216 instances
// of 5,000 triangles, beside one tree over all their triangles: rays visit 12.6 nodes through instances on a grid
// against 13.0 in the one tree, so there is nothing to win; in a heap, where each instance stands in dozens of others,
// 24.0 against 11.1 from outside and 21.1 against 11.7 from surface to surface.
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

// What a random ray through all is expected to meet (MacDonald and Booth 1990). 0 where the whole has no extent.
struct TopLevelCost {
  double node_visits = 0;       // of the wide tree
  double instance_entries = 0;  // whatever the tree is
};

// Boxes must not be empty or infinite; their numbers need not be rows. Throws Cancelled, bad_alloc.
[[nodiscard]] TopLevel build_top_level(std::span<const PrimRef> prims, ThreadPool& pool, CancelToken& cancel,
                                       std::uint32_t most_clusters = kMostClusters);

}  // namespace perfect_bvh
