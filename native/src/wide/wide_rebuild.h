// Tree rotations on the wide tree: restructuring what motion has degraded, without building anything (Kensler 2008,
// "Tree rotations for improving bounding volume hierarchies"; Kopta et al. 2012, "Fast, effective BVH updates for
// animated scenes", both for binary trees). In: a tree whose boxes are tight. Out: the same leaves under a tree of no
// higher cost.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "builders/builder.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "wide/wide_bvh.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {

// Goes once through the nodes, the lowest first. Below each node a child changes places with a child of a sibling, or
// a sibling's child takes a free place of the node, where the sibling's box shrinks by that. `costs` are those of the
// tree, and then of the tree as it has become. Returns the number of moves. The same bytes for any number of threads.
std::size_t rotate_wide(WideBvh& tree, WideCosts& costs, ThreadPool& pool, CancelToken& cancel);

// Wide rebuild --------------------------------------------------------------------------------------------------------
// Rebuilds the degraded parts of a wide tree, and only those, over their present leaves, which hold neighbouring
// triangles and suffer least when a mesh bends. A sixth of the boxes that a whole build would sort, and no leaf is
// written. The leaves themselves do not improve: a statue of 200 thousand triangles, twisted by 2 pi, costs 13.0
// after it and 11.7 in a new tree; over the same leaves the sweep builder and three passes of reinsertion reach
// 12.8. In: a refitted tree, its cost now and when it was built. Out: the same leaves under a better tree.

// The roots of the largest subtrees that are degraded themselves: that would cost more than `tolerance` times what they
// did when built even if everything below their children did not. By row; none inside another. `fresh` is by the same
// rows as `costs`.
[[nodiscard]] std::vector<std::uint32_t> find_degraded_parts(const WideBvh& tree, const WideCosts& costs,
                                                             const WideCosts& fresh, double tolerance,
                                                             CancelToken& cancel);

// How many of a tree's leaves stand below these nodes, none inside another: 0 to 1.
[[nodiscard]] double share_of_leaves(const WideBvh& tree, std::span<const std::uint32_t> roots, CancelToken& cancel);

// Rebuilds what is below each of `parts` (none inside another) over its leaves. `config` chooses the builder; what
// it says of leaves and reinsertion is ignored. `fresh` becomes what is to be compared with from now on: present
// costs for the new parts, but with leaves as good as they were when they were made. Returns the tree's costs of now.
// The same bytes for any number of threads. Throws Cancelled, bad_alloc; the tree is then of no use.
WideCosts rebuild_parts(WideBvh& tree, WideCosts& fresh, std::span<const std::uint32_t> parts,
                        const BuildConfig& config, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
