// The leaves of a wide tree straight from a mesh: triangles put in the order of their Morton codes and cut into runs
// that fit into leaves (Morton 1966; Lauterbach et al. 2009, "Fast BVH construction on GPUs").
// In: a mesh. Out: leaves along the curve, and their boxes.
#pragma once

#include "builders/locally_ordered.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/scratch.h"
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

}  // namespace perfect_bvh
