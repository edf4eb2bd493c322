// Puts trees together under new nodes, whatever built each (lecture, "Combining").
// In: trees. Out: one tree over all of their primitives; the nodes of the parts keep their boxes.
#pragma once

#include <cstdint>
#include <span>

#include "builders/bvh2.h"
#include "core/cancel.h"

namespace perfect_bvh {

struct TreePart {
  const Bvh2* tree;
  std::uint32_t prim_offset = 0;  // added to the numbers of its primitives
  std::uint32_t root = 0;         // what stands below this node is taken
};

// A copy of `top` in which each leaf is replaced by a part: the one whose number is the leaf's only row. Parts must not
// be empty. Boxes of `top` are not looked at: its nodes get the boxes of what stands below them. Throws
// InvalidArgument if the result would be deeper than kMaxTreeDepth; Cancelled.
[[nodiscard]] Bvh2 graft(const Bvh2& top, std::span<const TreePart> parts, CancelToken& cancel);

// Two trees under a new root. The numbers of the right tree's primitives are raised by `right_offset`. An empty tree
// adds nothing. Throws like graft().
[[nodiscard]] Bvh2 combine(const Bvh2& left, const Bvh2& right, std::uint32_t right_offset);

}  // namespace perfect_bvh
