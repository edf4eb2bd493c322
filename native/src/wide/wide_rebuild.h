// Tree rotations on the wide tree: restructures parts that motion has degraded, without building anything (Kensler
// 2008, "Tree rotations for improving bounding volume hierarchies"; Kopta et al. 2012, "Fast, effective BVH updates for
// animated scenes", both for binary trees). In: a tree whose boxes are tight. Out: the same leaves under a tree whose
// cost is not higher.
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

// Goes once through the nodes, from the lowest up. Below each node, a child is exchanged with a child of a sibling, or
// a sibling's child moves to a free slot of the node, if that shrinks the sibling's box. `costs` are the tree's costs;
// they are updated. Returns the number of moves. The same bytes for any number of threads.
std::size_t rotate_wide(WideBvh& tree, WideCosts& costs, ThreadPool& pool, CancelToken& cancel);

// Wide rebuild --------------------------------------------------------------------------------------------------------
// Rebuilds only the degraded parts of a wide tree, over their present leaves. Leaves hold neighbouring triangles, so
// they suffer least when a mesh bends. A rebuild sorts a sixth of the boxes that a whole build would sort, and writes
// no leaf. The leaves themselves do not improve: a statue of 200 thousand triangles, twisted by 2 pi, costs 13.0 after
// it and 11.7 in a new tree. Over the same leaves, the sweep builder and three passes of reinsertion reach 12.8. In: a
// refitted tree, its cost now and when it was built. Out: the same leaves under a better tree.

// Returns the roots of the largest subtrees that are degraded themselves: those that would cost more than `tolerance`
// times their cost when built, even if nothing below their children did. By row; none is inside another. `fresh` has
// the same rows as `costs`.
[[nodiscard]] std::vector<std::uint32_t> find_degraded_parts(const WideBvh& tree, const WideCosts& costs,
                                                             const WideCosts& fresh, double tolerance,
                                                             CancelToken& cancel);

// Returns the share of a tree's leaves that are below these nodes, from 0 to 1. No node may be inside another.
[[nodiscard]] double share_of_leaves(const WideBvh& tree, std::span<const std::uint32_t> roots, CancelToken& cancel);

// Rebuilds the subtrees of `parts` (none inside another) over their leaves. `config` chooses the builder; its settings
// for leaves and reinsertion are ignored. `fresh` becomes the new reference for comparisons: present costs for the new
// parts, but with leaves as good as when they were made. Returns the tree's present costs. The same bytes for any
// number of threads. Throws Cancelled, bad_alloc; the tree is then unusable.
WideCosts rebuild_parts(WideBvh& tree, WideCosts& fresh, std::span<const std::uint32_t> parts,
                        const BuildConfig& config, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
