#include "wide/bottom_up.h"

#include <cstddef>

namespace perfect_bvh {
namespace {

constexpr std::size_t kManySubtrees = 32;

bool is_node(std::uint32_t child) noexcept { return child != kNoChild && child < kBlockChild; }

// The rows of `root` and of the nodes below it, depth first.
std::vector<std::uint32_t> list_subtree(const WideBvh& tree, std::uint32_t root, CancelToken& cancel) {
  std::vector<std::uint32_t> rows, waiting{root};
  for (Steps steps(cancel); !waiting.empty(); steps.step()) {
    const std::uint32_t row = waiting.back();
    waiting.pop_back();
    rows.push_back(row);
    for (std::uint32_t lane = kWideWidth; lane-- > 0;) {
      const std::uint32_t child = tree.nodes[row].child[lane];
      if (!is_node(child)) continue;
      __builtin_prefetch(&tree.nodes[child].child);
      waiting.push_back(child);
    }
  }
  return rows;
}

}  // namespace

BottomUpOrder order_bottom_up(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel) {
  BottomUpOrder order;
  if (tree.nodes.empty()) return order;
  std::vector<std::uint32_t> roots{tree.root}, below;
  while (!roots.empty() && roots.size() < kManySubtrees) {
    below.clear();
    for (const std::uint32_t row : roots) {
      for (const std::uint32_t child : tree.nodes[row].child) {
        if (is_node(child)) below.push_back(child);
      }
    }
    order.upper.insert(order.upper.end(), roots.begin(), roots.end());
    roots.swap(below);
  }
  order.subtrees.resize(roots.size());
  for_chunks(pool, roots.size(), 1, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) order.subtrees[i] = list_subtree(tree, roots[i], cancel);
  });
  return order;
}

}  // namespace perfect_bvh
