// Where a subtree stands in its tree's array. In depth-first order the pairs of children below a node follow each
// other without a gap: so the sizes of subtrees are known without a walk, and each is a piece of work of its own.
#pragma once

#include <cstdint>

#include "builders/bvh2.h"

namespace perfect_bvh {

struct SubtreeRange {
  std::uint32_t node;
  std::uint32_t end;  // one past the last node below; without meaning for a leaf
};

[[nodiscard]] inline SubtreeRange whole_range(const Bvh2& tree) noexcept {
  return {0, static_cast<std::uint32_t>(tree.nodes.size())};
}
[[nodiscard]] inline SubtreeRange left_range(const Bvh2& tree, SubtreeRange range) noexcept {
  const std::uint32_t pair = tree.nodes[range.node].first;
  const Bvh2Node& right = tree.nodes[pair + 1];
  return {pair, right.is_leaf() ? range.end : right.first};
}
[[nodiscard]] inline SubtreeRange right_range(const Bvh2& tree, SubtreeRange range) noexcept {
  return {tree.nodes[range.node].first + 1, range.end};
}
// Nodes below.
[[nodiscard]] inline std::uint32_t size_of(const Bvh2& tree, SubtreeRange range) noexcept {
  const Bvh2Node& node = tree.nodes[range.node];
  return node.is_leaf() ? 0 : range.end - node.first;
}

}  // namespace perfect_bvh
