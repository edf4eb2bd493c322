// Lists the boxes of a tree as rays test them, to draw or to evaluate them.
// In: a snapshot, one of its trees, the levels. Out: each box with its level and its quality.
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

// The boxes of one tree, for display: columns of equal length, from the root downwards, level by level.
struct TreeBoxes {
  std::vector<double> corners;           // six per box: lower x, y, z, upper x, y, z
  std::vector<std::int32_t> levels;      // 0 for the root
  std::vector<std::int32_t> leaf_sizes;  // triangles of a leaf, 1 for an instance, 0 for an interior node
  std::vector<float> costs;              // its share of the surface area heuristic's cost
  std::vector<float> subtree_costs;      // of the box and everything below it
  std::vector<float> overlaps;           // area shared with its siblings, as a share of its area
  std::vector<std::int64_t> ranges;      // two per box: begin and end of its contents in `primitives`
  std::vector<std::int32_t> primitives;  // of the whole tree, leaf after leaf: triangles of the mesh, ids of instances
  std::uint32_t depth = 0;               // the deepest level of the whole tree
  double sah = 0;                        // of the whole tree: all costs together
  double built_sah = 0;                  // the same when it was built; it may have been refitted since
  [[nodiscard]] std::size_t count() const noexcept { return levels.size(); }
};

// Levels from `first` to `last`, both included; the root is level 0. With the leaves above, one level is a cut through
// the tree: each path from the root to a primitive passes one of its boxes.
struct LevelRange {
  std::uint32_t first = 0;
  std::uint32_t last = std::numeric_limits<std::uint32_t>::max();
  bool with_leaves_above = false;
};

// Returns the top level's root box, in its stored scale. A root that is an instance has no node around it.
[[nodiscard]] Aabb bounds_of_top_level(const Snapshot& snapshot);

// Lists the tree of a mesh, in the space of its object as the caller gave it, or the top level (no mesh_id), in world
// space. Costs are those of a random ray through the root's box, 1 for each visited node and each tested triangle or
// instance. Over all levels they add up to the SAH of the traced tree. The whole tree is visited once, even if only
// some levels are listed. Throws InvalidArgument for an unknown mesh, Cancelled, bad_alloc.
[[nodiscard]] TreeBoxes list_tree_boxes(const Snapshot& snapshot, std::optional<std::int32_t> mesh_id,
                                        LevelRange levels, CancelToken& cancel);

// Returns the `sah` of a mesh's tree as listed there, except for rounding, without listing anything. Throws the same.
[[nodiscard]] double tree_sah(const Snapshot& snapshot, std::int32_t mesh_id, CancelToken& cancel);

// Statistics ----------------------------------------------------------------------------------------------------------
// Measures a snapshot's trees.
// In: a snapshot. Out: sizes and quality of every mesh's tree and of the top level.

// is_detailed: also measures EPO and leaf-count variability, which take microseconds per triangle; trees that are no
// longer kept are rebuilt for that. Throws Cancelled, bad_alloc. The numbers do not depend on the number of threads.
[[nodiscard]] SceneStatistics measure(const Snapshot& snapshot, bool is_detailed, ThreadPool& pool,
                                      CancelToken& cancel);

}  // namespace perfect_bvh
