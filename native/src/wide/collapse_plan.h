// Which nodes of a binary tree become children of which wide node, and which subtrees become leaves: the choice of
// least expected cost (optimal collapse by dynamic programming, after Wald, Benthin and Boulos 2008 and Ylitie,
// Karras and Laine 2017).
// In: a binary tree, and what a leaf may hold. Out: a decision for every node, from which the wide tree is emitted.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "build/bvh2.h"
#include "core/cancel.h"
#include "mesh/triangle_mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Costs relative to visiting a wide node.
struct CollapseCosts {
  float node = 1.0f;
  float leaf = 0.5f;
};

// Up to 8 triangles over up to 8 vertices: the contents of a leaf block.
struct LeafSet {
  std::uint32_t primitive_count = 0, vertex_count = 0;
  std::array<std::uint32_t, 8> primitives, vertices;

  // False, and then unchanged in effect for the caller (who must drop it), if it does not fit.
  [[nodiscard]] bool add(std::uint32_t primitive, const TriangleIndices& corners) noexcept;
  [[nodiscard]] bool add(const LeafSet& other) noexcept;
};

// share[k - 2]: with k places for its subtree, a node gives this many to its left child; 0: it takes one place itself.
// as_root: the left share when it is a wide node itself. is_leaf: it becomes a leaf when it takes one place.
struct CollapseDecision {
  std::array<std::uint8_t, 7> share;
  std::uint8_t left_of_node : 7;
  std::uint8_t is_leaf : 1;
};
static_assert(sizeof(CollapseDecision) == 8);

// Triangles: null for a top level, whose leaves hold one primitive each. Every leaf of the tree must fit into one leaf
// of the wide tree (see split_leaves). One decision for each node.
[[nodiscard]] std::vector<CollapseDecision> plan_collapse(const Bvh2& tree, const TriangleIndices* triangles,
                                                          const CollapseCosts& costs, CancelToken& cancel);

// A copy of the tree whose leaves all fit into one leaf of the wide tree: those that do not are halved, with the boxes
// that they had (a clipped box says nothing of the halves). Empty (no nodes) if all of them fit already.
[[nodiscard]] Bvh2 split_leaves(const Bvh2& tree, const TriangleIndices* triangles);

// The nodes of the tree, parents first and left subtrees before right ones.
[[nodiscard]] std::vector<std::uint32_t> depth_first_order(const Bvh2& tree);

}  // namespace perfect_bvh
