// Tree rotations on the wide tree: restructuring what motion has degraded, without building anything (Kensler 2008,
// "Tree rotations for improving bounding volume hierarchies"; Kopta et al. 2012, "Fast, effective BVH updates for
// animated scenes", both for binary trees). In: a tree whose boxes are tight. Out: the same leaves under a tree of no
// higher cost.
#pragma once

#include <cstddef>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "wide/wide_bvh.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {

// Goes once through the nodes, the lowest first. Below each node a child changes places with a child of a sibling, or
// a sibling's child takes a free place of the node, where the sibling's box shrinks by that. `costs` are those of the
// tree, and then of the tree as it has become. Returns the number of moves. The same bytes for any number of threads.
std::size_t rotate_wide(WideBvh& tree, WideCosts& costs, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
