// The steps of a collapse from a binary tree to a wide one: leaves are made small enough, the wide nodes are chosen
// (collapse_plan.cpp), and the wide tree is written.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "builders/build_config.h"
#include "builders/bvh2.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "wide/leaf_block.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// A copy of the tree whose leaves all fit into one leaf of the wide tree: those that do not are halved, with the boxes
// that they had (a clipped box says nothing of the halves). Empty (no nodes) if all of them fit already.
[[nodiscard]] Bvh2 split_leaves(const Bvh2& tree, const LeafRoom& room, ThreadPool& pool, CancelToken& cancel);

// Costs relative to visiting a wide node.
struct CollapseCosts {
  float node = 1.0f;
  float leaf = 0.5f;
  float scale = 1.0f;  // of the boxes whose surfaces are compared: very large ones would leave the range of float
  // Of each wide node besides its visits, for the memory that it takes: in units of the root's area, shared out among
  // the primitives. It fills nodes better where they are so small that rays hardly meet them.
  float memory = 0.0f;
};

// share[k - 2]: with k places for its subtree, a node gives this many to its left child; 0: it takes one place itself.
// left_of_node: the left share when it is a wide node itself. is_leaf: it becomes a leaf when it takes one place.
struct CollapseDecision {
  std::array<std::uint8_t, 7> share;
  std::uint8_t left_of_node : 7;
  std::uint8_t is_leaf : 1;
};
static_assert(sizeof(CollapseDecision) == 8);

// Every leaf of the tree must fit into one leaf of the wide tree (see split_leaves). One decision for each node. Throws
// EngineError if the tree is not in depth-first order.
[[nodiscard]] AlignedVector<CollapseDecision> plan_collapse(const Bvh2& tree, const LeafRoom& room,
                                                            const CollapseCosts& costs, ThreadPool& pool,
                                                            CancelToken& cancel);

// Writes the wide tree that was planned, depth first.
// Fills in nodes, leaves, root and depth; the scale must be set. Mesh: null for a top level. Threads share out
// subtrees: they first count what each will need, then write it where it belongs. Throws EngineError if the tree gets
// more nodes, leaves or instances than a child can refer to.
void emit_wide(const Bvh2& tree, const Mesh* mesh, std::span<const CollapseDecision> decisions, WideBvh& wide,
               ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
