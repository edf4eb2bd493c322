// Builds a tree from the leaves upwards, by repeatedly joining the two clusters with the smallest joint box (lecture,
// "Building the top level"). It follows best matches from cluster to cluster, and joins two that are each other's best
// at once. The tree is the same as if all pairs were tried each time.
// In: boxes and a tree over them to search in. Out: a tree with one primitive per leaf.
// Source: Walter, Bala, Kulkarni and Pingali 2008, "Fast Agglomerative Clustering for Rendering", section 3.
#pragma once

#include <cstdint>
#include <span>

#include "builders/builder.h"
#include "builders/bvh2.h"
#include "builders/grid.h"
#include "core/cancel.h"

namespace perfect_bvh {

// Builds a new tree over the boxes below `node` of `guide`, a tree with one row of `prims` per leaf. The result also
// refers to rows. Takes O(N log N) steps if boxes are spread out; ties are broken by row. Chains that would exceed
// kMaxTreeDepth, counted from `levels_above` its root, are repeatedly halved from the level where that becomes
// necessary.
[[nodiscard]] Bvh2 build_agglomerative(const Bvh2& guide, std::uint32_t node, std::span<const PrimRef> prims,
                                       CancelToken& cancel, std::uint32_t levels_above = 0);

// Few boxes -----------------------------------------------------------------------------------------------------------
// Splits a handful of boxes: tries every way to halve up to four of them, and every plane for up to eight. Most of a
// tree's nodes are that small; bins would cost more there and find less. Subdivision ends here, too: no split is made
// that costs more than a leaf (lecture, "Termination"). In: boxes on a grid, the SAH's costs. Out: the boxes that go
// left.

inline constexpr std::uint32_t kFewBoxes = 8;

// Returns bit i set if box i goes left. Returns 0 if a leaf costs no more than the best split, or (only past
// max_leaf_size) no split gains anything. `count` is 2 to kFewBoxes; `area` is the half area of all.
[[nodiscard]] std::uint32_t split_few(const GridBox* boxes, std::uint32_t count, float area,
                                      const BuildConfig& config) noexcept;

}  // namespace perfect_bvh
