// Makes the tree that rays are traced through from a binary one.
// In: any Bvh2 (also with spatial splits), and its triangles. Out: a WideBvh, the same bytes on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "builders/builder.h"
#include "builders/bvh2.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "wide/leaf_block.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

[[nodiscard]] WideBvh collapse_mesh(const Bvh2& tree, const Mesh& mesh, ThreadPool& pool, CancelToken& cancel);

// Collapses a tree over instances (their world boxes). Each leaf refers to one instance.
[[nodiscard]] WideBvh collapse_top_level(const Bvh2& tree, ThreadPool& pool, CancelToken& cancel);

// Collapses a tree over two or more leaf blocks of a wide tree (their boxes as stored, numbered by row). Returns the
// nodes above them, the root first.
[[nodiscard]] AlignedVector<WideNode> collapse_over_leaves(const Bvh2& tree, ThreadPool& pool, CancelToken& cancel);

// Collapse steps ------------------------------------------------------------------------------------------------------
// The steps of a collapse from a binary tree to a wide one: split large leaves, choose the wide nodes, write the wide
// tree.

// Returns a copy of the tree in which every leaf fits into one leaf of the wide tree. Larger leaves are halved; the
// halves keep the leaf's box, as a clipped box gives no bounds for them. Empty (no nodes) if all leaves fit already.
[[nodiscard]] Bvh2 split_leaves(const Bvh2& tree, const LeafRoom& room, ThreadPool& pool, CancelToken& cancel);

// Costs relative to visiting a wide node.
struct CollapseCosts {
  float node = 1.0f;
  float leaf = 0.5f;
  float scale = 1.0f;  // of the boxes whose surfaces are compared: very large ones would leave the range of float
  // The cost of a wide node's memory, in addition to its visits: in units of the root's area, divided by the number of
  // primitives. It makes nodes fuller where they are so small that rays hardly hit them.
  float memory = 0.0f;
};

// share[k - 2]: if its subtree has k slots, a node gives this many to its left child; 0: it takes one slot itself.
// left_of_node: the left share if it is a wide node itself. is_leaf: it becomes a leaf if it takes one slot.
struct CollapseDecision {
  std::array<std::uint8_t, 7> share;
  std::uint8_t left_of_node : 7;
  std::uint8_t is_leaf : 1;
};
static_assert(sizeof(CollapseDecision) == 8);

// Makes one decision for each node. Every leaf of the tree must fit into one leaf of the wide tree (see split_leaves).
// Throws EngineError if the tree is not in depth-first order.
[[nodiscard]] AlignedVector<CollapseDecision> plan_collapse(const Bvh2& tree, const LeafRoom& room,
                                                            const CollapseCosts& costs, ThreadPool& pool,
                                                            CancelToken& cancel);

// Writes the planned wide tree, depth first.
// Fills in nodes, leaves, root and depth; the scale must be set. `mesh` is null for a top level. Threads divide the
// subtrees: they first count the rows that each needs, then write them to their final position. Throws EngineError if
// the tree gets more nodes or leaves than a child can refer to.
void emit_wide(const Bvh2& tree, const Mesh* mesh, std::span<const CollapseDecision> decisions, WideBvh& wide,
               ThreadPool& pool, CancelToken& cancel);

// Visit order ---------------------------------------------------------------------------------------------------------
// The order in which a ray visits the children of a wide node.

// Fills in `order` of a node whose first `count` slots are used. The child whose box is farthest along the diagonal of
// a ray's octant comes first, because the last child pushed is visited first. Computes four octants; the opposite ones
// use the reverse.
void set_visit_order(WideNode& node, std::uint32_t count) noexcept;

}  // namespace perfect_bvh
