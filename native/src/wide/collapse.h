// Makes the tree that rays are traced through from a binary one.
// In: any Bvh2 (spatial splits too), and the triangles it stands over. Out: a WideBvh, the same bytes whatever machine
// made it.
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

// Over instances (their world boxes): leaves refer to one each.
[[nodiscard]] WideBvh collapse_top_level(const Bvh2& tree, ThreadPool& pool, CancelToken& cancel);

// Over two leaf blocks or more of a wide tree (their boxes as stored, numbered by row): the nodes above them, the root
// first.
[[nodiscard]] AlignedVector<WideNode> collapse_over_leaves(const Bvh2& tree, ThreadPool& pool, CancelToken& cancel);

// Collapse steps ------------------------------------------------------------------------------------------------------
// The steps of a collapse from a binary tree to a wide one: leaves are made small enough, the wide nodes are chosen
// and the wide tree is written.

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

// Visit order ---------------------------------------------------------------------------------------------------------
// In which order a ray visits the children of a wide node.

// Fills in `order` of a node whose first `count` places are taken: the child whose box stands farthest along the
// diagonal of a ray's octant comes first, since what is pushed last is visited first. For four octants; the opposite
// ones see the reverse.
void set_visit_order(WideNode& node, std::uint32_t count) noexcept;

}  // namespace perfect_bvh
