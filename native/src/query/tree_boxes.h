// Lists the boxes of a tree as rays meet them, for whoever wants to draw or to judge them.
// In: a snapshot, which of its trees, which levels. Out: each box with its level and what is wrong with it.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "core/cancel.h"
#include "stats/tree_boxes.h"
#include "tlas/snapshot.h"

namespace perfect_bvh {

// From `first` to `last`, both included; the root is level 0.
struct LevelRange {
  std::uint32_t first = 0;
  std::uint32_t last = std::numeric_limits<std::uint32_t>::max();
};

// The tree of a mesh, in the space of its object as the caller gave it, or the top level (no mesh_id), in the world.
// A lazy mesh that no ray has reached has no boxes.
// Costs are those of a random ray through the root's box, 1 for each visited node and each tested triangle or instance:
// over all levels they add up to the SAH of the tree that is traced. Throws InvalidArgument for an unknown mesh,
// Cancelled, bad_alloc.
[[nodiscard]] TreeBoxes list_tree_boxes(const Snapshot& snapshot, std::optional<std::int32_t> mesh_id,
                                        LevelRange levels, CancelToken& cancel);

}  // namespace perfect_bvh
