// Scalar traversal of a binary tree, nearest child first: the reference that faster kernels are compared with.
// In: a tree, a slab ray and its range. Out: calls of `visit_leaf` for every leaf that the range reaches.
#pragma once

#include <span>
#include <utility>

#include "build/bvh2.h"
#include "math/slab.h"
#include "stats/ray_counts.h"

namespace perfect_bvh {

struct StackEntry {
  std::uint32_t node;
  float near;
};

// `stack` holds at least tree.depth + 1 entries. visit_leaf(first, count, t_max) -> true to stop; it may lower t_max
// when it finds a hit. A box that starts exactly at t_max is still visited: an equal hit may win the tie.
template <class VisitLeaf>
void traverse_bvh2(const Bvh2& tree, const SlabRay& ray, float t_min, float& t_max, std::span<StackEntry> stack,
                   RayCounts* counts, VisitLeaf&& visit_leaf) noexcept {
  if (tree.empty()) return;
  const Bvh2Node* const nodes = tree.nodes.data();
  const SlabRange root = ray.range(nodes[0].lower, nodes[0].upper, t_min, t_max);
  if (counts != nullptr) ++counts->nodes_visited;
  if (!(root.near <= root.far)) return;
  std::size_t depth = 0;
  std::uint32_t index = 0;
  for (;;) {
    const Bvh2Node& node = nodes[index];
    if (node.is_leaf()) {
      if (visit_leaf(node.first, node.count, t_max)) return;
    } else {
      const Bvh2Node &left = nodes[node.first], &right = nodes[node.first + 1];
      const SlabRange left_range = ray.range(left.lower, left.upper, t_min, t_max);
      const SlabRange right_range = ray.range(right.lower, right.upper, t_min, t_max);
      const bool enters_left = left_range.near <= left_range.far, enters_right = right_range.near <= right_range.far;
      if (counts != nullptr) counts->nodes_visited += 2;
      if (enters_left && enters_right) {
        const bool left_first = left_range.near <= right_range.near;
        stack[depth++] =
            left_first ? StackEntry{node.first + 1, right_range.near} : StackEntry{node.first, left_range.near};
        index = left_first ? node.first : node.first + 1;
        continue;
      }
      if (enters_left || enters_right) {
        index = enters_left ? node.first : node.first + 1;
        continue;
      }
    }
    do {
      if (depth == 0) return;
      --depth;
    } while (stack[depth].near > t_max);
    index = stack[depth].node;
  }
}

}  // namespace perfect_bvh
