#include <atomic>
#include <vector>

#include "core/steps.h"
#include "wide/collapse_steps.h"
#include "wide/leaf_block.h"

namespace perfect_bvh {
namespace {

bool fits(const Bvh2& tree, const Bvh2Node& leaf, const LeafRoom& room) noexcept {
  return room.holds({tree.prim_indices.data() + leaf.first, leaf.count});
}

bool all_fit(const Bvh2& tree, const LeafRoom& room, ThreadPool& pool, CancelToken& cancel) {
  constexpr std::size_t kGrain = 32768;
  std::atomic<bool> all{true};
  for_chunks(pool, tree.nodes.size(), kGrain, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end && all.load(std::memory_order_relaxed); ++i) {
      if (tree.nodes[i].is_leaf() && !fits(tree, tree.nodes[i], room)) all.store(false, std::memory_order_relaxed);
    }
  });
  return all.load();
}

}  // namespace

Bvh2 split_leaves(const Bvh2& tree, const LeafRoom& room, ThreadPool& pool, CancelToken& cancel) {
  Bvh2 result;
  if (tree.has_full_leaves || all_fit(tree, room, pool, cancel)) return result;
  result.prim_indices = tree.prim_indices;
  result.refittable = tree.refittable;
  result.nodes.reserve(tree.nodes.size() * 2);
  result.nodes.resize(2);
  result.nodes[1] = {{}, 0, {}, 0};  // the root's sibling, unused
  struct Waiting {
    Bvh2Node node;
    std::uint32_t to;
  };
  std::vector<Waiting> waiting{{tree.nodes[0], 0}};
  for (Steps steps(cancel); !waiting.empty(); steps.step()) {
    const auto [node, to] = waiting.back();
    waiting.pop_back();
    result.nodes[to] = node;
    Bvh2Node left = node, right = node;
    if (!node.is_leaf()) {
      left = tree.nodes[node.first], right = tree.nodes[node.first + 1];
    } else if (!fits(tree, node, room)) {
      left.count = node.count / 2;
      right.first = node.first + left.count, right.count = node.count - left.count;
    } else {
      continue;
    }
    const auto pair = static_cast<std::uint32_t>(result.nodes.size());
    result.nodes[to].first = pair;
    result.nodes[to].count = 0;
    result.nodes.resize(pair + 2);
    waiting.push_back({right, pair + 1});
    waiting.push_back({left, pair});
  }
  return result;
}

}  // namespace perfect_bvh
