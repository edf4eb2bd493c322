// Every node of a wide tree, children before their parents, by several threads: subtrees are tasks, the few nodes
// above them follow. Any order of the array will do, so that parts of a tree may be exchanged.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Lists of nodes in which parents come first: one is to go through them from the last to the first. Every node is in
// one list. The same lists for any number of threads.
struct BottomUpOrder {
  std::vector<std::vector<std::uint32_t>> subtrees;  // none below another
  std::vector<std::uint32_t> upper;                  // all that is above them
};

[[nodiscard]] BottomUpOrder order_bottom_up(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel);

// Calls visit(rows) with each list, the upper one last and all others in no order, on any thread.
template <class Visit>
void visit_bottom_up(const BottomUpOrder& order, ThreadPool& pool, CancelToken& cancel, const Visit& visit) {
  parallel_for(pool, order.subtrees.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      cancel.checkpoint();
      visit(std::span<const std::uint32_t>(order.subtrees[i]));
    }
  });
  visit(std::span<const std::uint32_t>(order.upper));
}

template <class Visit>
void visit_bottom_up(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel, const Visit& visit) {
  visit_bottom_up(order_bottom_up(tree, pool, cancel), pool, cancel, visit);
}

}  // namespace perfect_bvh
