// The memory of a wide tree that nobody traces any more, for the next one of the same mesh: a system takes as long to
// hand out new memory as a refit takes to fill it. Snapshots may outlive each other in any order, on any thread: a tree
// comes here when the last of those that trace it lets it go.
#pragma once

#include <cstdint>
#include <mutex>
#include <utility>

#include "wide/wide_bvh.h"

namespace perfect_bvh {

// A number for the shape of a wide tree: which nodes, leaves and triangles are where. Trees of the same number differ
// in boxes and positions alone. 0: unknown.
[[nodiscard]] std::uint64_t new_tree_shape() noexcept;

class SpareTree {
 public:
  struct Tree {
    WideBvh wide;
    std::uint64_t shape = 0;
  };

  void give(Tree tree) noexcept {
    const std::lock_guard lock(mutex_);
    std::swap(tree_, tree);
  }
  // What was given last; empty if there is nothing.
  [[nodiscard]] Tree take() noexcept {
    const std::lock_guard lock(mutex_);
    return std::exchange(tree_, Tree{});
  }

 private:
  std::mutex mutex_;
  Tree tree_;
};

}  // namespace perfect_bvh
