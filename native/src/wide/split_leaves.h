// Makes leaves small enough for the wide tree.
#pragma once

#include "builders/build_config.h"
#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/triangle_mesh.h"

namespace perfect_bvh {

// A copy of the tree whose leaves all fit into one leaf of the wide tree: those that do not are halved, with the boxes
// that they had (a clipped box says nothing of the halves). Empty (no nodes) if all of them fit already.
// Triangles: null for a top level, whose leaves hold one primitive each.
[[nodiscard]] Bvh2 split_leaves(const Bvh2& tree, const TriangleIndices* triangles, TreeLayout layout, ThreadPool& pool,
                                CancelToken& cancel);

}  // namespace perfect_bvh
