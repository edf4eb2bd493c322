// Which clusters of a binary tree over leaf blocks become children of which wide node: the choice of least expected
// cost, as in collapse.cpp, for trees whose leaves are made already.
// In: a cluster tree. Out: a decision for every cluster of two.
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "builders/locally_ordered.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// What a subtree costs with 1 to 8 places. The lowest three bits say how many of them go to the left child: 0 if the
// cluster takes one place itself. Those of one place say how a node of its own would divide its eight.
struct alignas(32) PlacesPlan {
  float cost[8];

  [[nodiscard]] std::uint32_t to_left(std::uint32_t place_count) const noexcept {
    return std::bit_cast<std::uint32_t>(cost[place_count - 1]) & 7u;
  }
};

// One for each cluster that is made of two, at its number less that of boxes. In `scratch`.
[[nodiscard]] std::span<const PlacesPlan> plan_places(const ClusterTree& tree, Scratch& scratch, ThreadPool& pool,
                                                      CancelToken& cancel);

// Bottom up -----------------------------------------------------------------------------------------------------------
// Every node of a wide tree, children before their parents, by several threads: subtrees are tasks, the few nodes
// above them follow. Any order of the array will do, so that parts of a tree may be exchanged.

// Lists of nodes in which parents come first: one is to go through them from the last to the first. Every node is in
// one list. The same lists for any number of threads.
struct BottomUpOrder {
  std::vector<std::vector<std::uint32_t>> subtrees;  // none below another
  std::vector<std::uint32_t> upper;                  // all that is above them
};

[[nodiscard]] BottomUpOrder order_bottom_up(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel);

// Calls visit(rows) with each list, the upper one last and all others in no order, on any thread. Of a long list the
// last rows come first, a part at a time.
template <class Visit>
void visit_bottom_up(const BottomUpOrder& order, ThreadPool& pool, CancelToken& cancel, const Visit& visit) {
  const auto visit_list = [&](std::span<const std::uint32_t> rows) {
    for_steps_back(rows.size(), cancel,
                   [&](std::size_t begin, std::size_t end) { visit(rows.subspan(begin, end - begin)); });
  };
  for_chunks(pool, order.subtrees.size(), 1, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) visit_list(order.subtrees[i]);
  });
  visit_list(order.upper);
}

template <class Visit>
void visit_bottom_up(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel, const Visit& visit) {
  visit_bottom_up(order_bottom_up(tree, pool, cancel), pool, cancel, visit);
}

}  // namespace perfect_bvh
