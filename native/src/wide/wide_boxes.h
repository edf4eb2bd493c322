// The boxes of a wide tree, as they are stored: in the tree's scale.
#pragma once

#include <cstdint>

#include "math/aabb.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Empty for a place that is not taken.
[[nodiscard]] inline Aabb child_box(const WideNode& node, std::uint32_t lane) noexcept {
  return {{node.planes[0][lane], node.planes[2][lane], node.planes[4][lane]},
          {node.planes[1][lane], node.planes[3][lane], node.planes[5][lane]}};
}

[[nodiscard]] inline Aabb block_box(const LeafBlock& block) noexcept {
  Aabb box;
  for (int i = 0; i < 8; ++i) {
    box.grow(Vec3f{block.vertices[0][i], block.vertices[1][i], block.vertices[2][i]});
  }
  return box;
}

[[nodiscard]] inline std::uint32_t triangle_count_of(const LeafBlock& block) noexcept {
  std::uint32_t count = 1;
  for (int i = 1; i < 8; ++i) count += block.primitives[i] != block.primitives[i - 1] ? 1u : 0u;
  return count;
}

// Of a tree over triangles; empty for an empty tree.
[[nodiscard]] inline Aabb bounds_of(const WideBvh& tree) noexcept {
  Aabb box;
  if (tree.is_empty) return box;
  if (tree.root >= kBlockChild) return block_box(tree.blocks[tree.root - kBlockChild]);
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) box.grow(child_box(tree.nodes[tree.root], lane));
  return box;
}

}  // namespace perfect_bvh
