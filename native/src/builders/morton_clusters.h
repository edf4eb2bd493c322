// Clusters: references put in the order of their Morton codes and cut into short rows of neighbours, which a builder
// can treat as one. A row is a subtree of the codes' radix tree (Garanzha et al. 2011, "Simpler and faster HLBVH with
// work queues", build over such clusters by binning), cut smaller where its members leave much of its box empty. In:
// references. Out: the references in order, and the clusters' rows and boxes.
#pragma once

#include <cstdint>
#include <span>

#include "builders/primitives.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

inline constexpr std::uint32_t kMaxClusterSize = 8;

struct ClusterRows {
  std::uint32_t first;  // row of MortonClusters::prims
  std::uint32_t count;  // 1 to kMaxClusterSize
};

struct MortonClusters {
  AlignedVector<PrimRef> prims;     // the input's, in order
  AlignedVector<PrimRef> boxes;     // of the clusters; prim_index is the cluster's number
  AlignedVector<ClusterRows> rows;  // by cluster number
};

// The same for any number of threads. Throws Cancelled, bad_alloc.
[[nodiscard]] MortonClusters make_morton_clusters(std::span<const PrimRef> prims, ThreadPool& pool,
                                                  CancelToken& cancel);

}  // namespace perfect_bvh
