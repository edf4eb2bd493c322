// Every node of a wide tree, children before their parents, by several threads: subtrees are shared out, the few nodes
// above them follow. Nothing is asked of the order of the array, so that parts of a tree may be exchanged.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// The rows of the nodes below `root` and its own, each parent before its children.
inline void list_subtree(const WideBvh& tree, std::uint32_t root, std::vector<std::uint32_t>& rows) {
  std::vector<std::uint32_t> waiting{root};
  while (!waiting.empty()) {
    const std::uint32_t row = waiting.back();
    waiting.pop_back();
    rows.push_back(row);
    for (std::uint32_t lane = kWideWidth; lane-- > 0;) {
      const std::uint32_t child = tree.nodes[row].child[lane];
      if (child == kNoChild || child >= kBlockChild) continue;
      __builtin_prefetch(&tree.nodes[child].child);
      waiting.push_back(child);
    }
  }
}

// Calls visit(rows) with lists of nodes in which parents come first: it is to go through them from the last to the
// first. Every node is in one list; those below it come before it or in a list that was visited earlier. Lists do not
// depend on the number of threads.
template <class Visit>
void visit_bottom_up(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel, const Visit& visit) {
  if (tree.nodes.empty()) return;
  constexpr std::size_t kManySubtrees = 32;
  std::vector<std::uint32_t> upper, subtrees{tree.root}, below;
  while (!subtrees.empty() && subtrees.size() < kManySubtrees) {
    below.clear();
    for (const std::uint32_t row : subtrees) {
      for (const std::uint32_t child : tree.nodes[row].child) {
        if (child != kNoChild && child < kBlockChild) below.push_back(child);
      }
    }
    upper.insert(upper.end(), subtrees.begin(), subtrees.end());
    subtrees.swap(below);
  }
  parallel_for(pool, subtrees.size(), 1, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> rows;
    for (std::size_t i = begin; i < end; ++i) {
      cancel.checkpoint();
      rows.clear();
      list_subtree(tree, subtrees[i], rows);
      visit(std::span<const std::uint32_t>(rows));
    }
  });
  visit(std::span<const std::uint32_t>(upper));
}

}  // namespace perfect_bvh
