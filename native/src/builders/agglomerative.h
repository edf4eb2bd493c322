// Builds a tree from the leaves upwards: the two clusters with the smallest joint box are joined, again and again
// (lecture, "Building the top level"). Best matches are followed from cluster to cluster, and two that are each
// other's best are joined at once: the tree is the one that trying all pairs each time would give.
// In: boxes and a tree over them to search in. Out: a tree with one primitive a leaf.
// Source: Walter, Bala, Kulkarni and Pingali 2008, "Fast Agglomerative Clustering for Rendering", section 3.
#pragma once

#include <cstdint>
#include <span>

#include "builders/builder.h"
#include "builders/bvh2.h"
#include "builders/grid.h"
#include "core/cancel.h"

namespace perfect_bvh {

// A new tree over the boxes below `node` of `guide`, a tree with one row of `prims` a leaf. The result refers to rows
// too. Takes O(N log N) steps where boxes are spread; ties go by row. Chains that would leave kMaxTreeDepth, counted
// from `levels_above` its root, are halved again and again from where that becomes necessary.
[[nodiscard]] Bvh2 build_agglomerative(const Bvh2& guide, std::uint32_t node, std::span<const PrimRef> prims,
                                       CancelToken& cancel, std::uint32_t levels_above = 0);

// Few boxes -----------------------------------------------------------------------------------------------------------
// How to split a handful of boxes: every way to halve up to four of them, every plane for up to eight. Most of a
// tree's nodes are that small, and bins would cost more there and find less. Subdivision ends here, too: no split is
// made that costs more than a leaf (lecture, "Termination"). In: boxes on a grid, the SAH's costs. Out: which of them
// go left.

inline constexpr std::uint32_t kFewBoxes = 8;

// Bit i: box i goes left. 0: a leaf costs no more than the best split, or (only past max_leaf_size) no split gains
// anything. `count` is 2 to kFewBoxes; `area` is the half area of all.
[[nodiscard]] std::uint32_t split_few(const GridBox* boxes, std::uint32_t count, float area,
                                      const BuildConfig& config) noexcept;

}  // namespace perfect_bvh
