// Which clusters of a binary tree over leaf blocks become children of which wide node: the choice of least expected
// cost, as in collapse_plan.cpp, for trees whose leaves are made already.
// In: a cluster tree. Out: a decision for every cluster of two.
#pragma once

#include <bit>
#include <cstdint>
#include <span>

#include "builders/locally_ordered.h"
#include "core/cancel.h"
#include "core/scratch.h"
#include "core/thread_pool.h"

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

}  // namespace perfect_bvh
