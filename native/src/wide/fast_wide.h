// Makes the leaves of a wide tree directly from a mesh: triangles are sorted by their Morton codes and cut into runs
// that fit into leaves (Morton 1966; Lauterbach et al. 2009, "Fast BVH construction on GPUs").
// In: a mesh. Out: leaves along the curve, and their boxes.
#pragma once

#include <span>

#include "builders/builder.h"
#include "builders/locally_ordered.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

struct MortonLeaves {
  WideBvh tree;           // has only leaves yet
  BoxesAlongCurve boxes;  // of the leaves, in the tree's scale
  Aabb bounds;            // of all triangles, in the mesh's scale
};

// The boxes are in `tree_memory`, which also reserves memory for a tree over them. The same bytes for any number of
// threads. The mesh is not empty. Throws Cancelled, EngineError, bad_alloc.
[[nodiscard]] MortonLeaves make_morton_leaves(const Mesh& mesh, Scratch& tree_memory, ThreadPool& pool,
                                              CancelToken& cancel);

// Fast wide -----------------------------------------------------------------------------------------------------------
// Builds a wide tree directly from a mesh, without keeping a binary tree in between. It is for topology that changes
// every frame (lecture, "Rapid construction"). Leaves along a Morton curve are clustered in place, and the clusters are
// collapsed directly. This takes a third to a quarter of the time of any builder whose tree is collapsed afterwards.
// In: a mesh. Out: a WideBvh, the same bytes for any number of threads.

// Returns an empty tree if there are no triangles. Throws Cancelled, EngineError, bad_alloc.
[[nodiscard]] WideBvh build_fast_wide(const Mesh& mesh, ThreadPool& pool, CancelToken& cancel);
// The same for a top level over instances, at least one: their world boxes, numbered by row.
[[nodiscard]] WideBvh build_fast_top_level(std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
