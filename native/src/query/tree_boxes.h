// Lists the boxes of a tree as rays meet them, to draw or to judge them.
// In: a snapshot, which of its trees, which levels. Out: each box with its level and what is wrong with it.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "stats/statistics.h"
#include "tlas/assemble.h"

namespace perfect_bvh {

// The boxes of one tree, to be looked at: columns of equal length, from the root downwards, a level after the other.
struct TreeBoxes {
  std::vector<double> corners;           // six a box: lower x, y, z, upper x, y, z
  std::vector<std::int32_t> levels;      // 0 for the root
  std::vector<std::int32_t> leaf_sizes;  // triangles of a leaf, 1 for an instance, 0 for an interior node
  std::vector<float> costs;              // its share of the surface area heuristic's cost
  std::vector<float> subtree_costs;      // that of it and of all below it
  std::vector<float> overlaps;           // area shared with its siblings, as a share of its own
  std::vector<std::int64_t> ranges;      // two a box: where in `primitives` what it holds begins, and ends
  std::vector<std::int32_t> primitives;  // of the whole tree, leaf after leaf: triangles of the mesh, ids of instances
  std::uint32_t depth = 0;               // the deepest level of the whole tree
  double sah = 0;                        // of the whole tree: all costs together
  double built_sah = 0;                  // the same when it was built; it may have been refitted since
  [[nodiscard]] std::size_t count() const noexcept { return levels.size(); }
};

// From `first` to `last`, both included; the root is level 0. With the leaves above, one level is a cut through the
// tree: each way down from the root to a primitive meets one of its boxes.
struct LevelRange {
  std::uint32_t first = 0;
  std::uint32_t last = std::numeric_limits<std::uint32_t>::max();
  bool with_leaves_above = false;
};

// The top level's own root box, in its stored scale: a root that is an instance has no node around it.
[[nodiscard]] Aabb bounds_of_top_level(const Snapshot& snapshot);

// The tree of a mesh, in the space of its object as the caller gave it, or the top level (no mesh_id), in the world.
// Costs are those of a random ray through the root's box, 1 for each visited node and each tested triangle or instance:
// over all levels they add up to the SAH of the tree that is traced. Whichever levels are listed, the whole tree is
// gone through once. Throws InvalidArgument for an unknown mesh, Cancelled, bad_alloc.
[[nodiscard]] TreeBoxes list_tree_boxes(const Snapshot& snapshot, std::optional<std::int32_t> mesh_id,
                                        LevelRange levels, CancelToken& cancel);

// Of a mesh's tree the `sah` that is listed there, but for rounding, without listing anything. Throws the same.
[[nodiscard]] double tree_sah(const Snapshot& snapshot, std::int32_t mesh_id, CancelToken& cancel);

// Statistics ----------------------------------------------------------------------------------------------------------
// Measures a snapshot's trees.
// In: a snapshot. Out: sizes and quality of every mesh's tree and of the top level.

// is_detailed: also EPO and leaf-count variability, which take microseconds for each triangle; trees that are no longer
// kept are built again for them. Throws Cancelled, bad_alloc. The same numbers for any thread count.
[[nodiscard]] SceneStatistics measure(const Snapshot& snapshot, bool is_detailed, ThreadPool& pool,
                                      CancelToken& cancel);

}  // namespace perfect_bvh
