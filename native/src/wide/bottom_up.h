// Chooses which clusters of a binary tree over leaf blocks become the children of each wide node. The choice has the
// least expected cost, as in collapse.cpp, but the leaves exist already.
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

// The cost of a subtree with 1 to 8 slots. The lowest three bits are the number of slots for the left child, or 0 if
// the cluster takes one slot itself. In the first entry they say how the cluster, as a node itself, would divide its
// eight.
struct alignas(32) PlacesPlan {
  float cost[8];

  [[nodiscard]] std::uint32_t to_left(std::uint32_t place_count) const noexcept {
    return std::bit_cast<std::uint32_t>(cost[place_count - 1]) & 7u;
  }
};

// Makes one plan for each cluster that joins two; its index is the cluster's number minus the number of boxes. In
// `scratch`.
[[nodiscard]] std::span<const PlacesPlan> plan_places(const ClusterTree& tree, Scratch& scratch, ThreadPool& pool,
                                                      CancelToken& cancel);

// Bottom up -----------------------------------------------------------------------------------------------------------
// Visits every node of a wide tree, children before their parents, on several threads: subtrees are tasks, and the few
// nodes above them follow. The array may be in any order, so that parts of a tree can be replaced.

// Lists of nodes in which parents come first: iterate over them from the last to the first. Every node is in one list.
// The lists do not depend on the number of threads.
struct BottomUpOrder {
  std::vector<std::vector<std::uint32_t>> subtrees;  // none below another
  std::vector<std::uint32_t> upper;                  // all nodes above them
};

[[nodiscard]] BottomUpOrder order_bottom_up(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel);

// Calls visit(rows) with each list: the upper one last, the others in any order on any thread. A long list is passed in
// chunks, its last rows first.
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
