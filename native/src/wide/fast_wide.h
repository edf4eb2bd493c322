// The leaves of a wide tree straight from a mesh: triangles put in the order of their Morton codes and cut into runs
// that fit into leaves (Morton 1966; Lauterbach et al. 2009, "Fast BVH construction on GPUs").
// In: a mesh. Out: leaves along the curve, and their boxes.
#pragma once

#include "builders/builder.h"
#include "builders/locally_ordered.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

struct MortonLeaves {
  WideBvh tree;           // so far of leaves alone
  BoxesAlongCurve boxes;  // of the leaves, in the tree's scale
  Aabb bounds;            // of all triangles, in the mesh's
};

// The boxes stand in `tree_memory`, which is told what a tree over them will take. The same bytes for any number of
// threads. The mesh is not empty. Throws Cancelled, EngineError, bad_alloc.
[[nodiscard]] MortonLeaves make_morton_leaves(const Mesh& mesh, Scratch& tree_memory, ThreadPool& pool,
                                              CancelToken& cancel);

// Fast wide -----------------------------------------------------------------------------------------------------------
// A wide tree straight from a mesh, without a binary tree in between that would be kept: for topology that changes
// every frame (lecture, "Rapid construction"). Leaves along a Morton curve, clustered in place, collapsed as they are:
// a third to a quarter of the time of any builder whose tree is collapsed afterwards.
// In: a mesh. Out: a WideBvh, the same bytes for any number of threads.

// Empty over no triangles. Throws Cancelled, EngineError, bad_alloc.
[[nodiscard]] WideBvh build_fast_wide(const Mesh& mesh, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
