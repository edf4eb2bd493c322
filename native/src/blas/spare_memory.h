// Memory that is no longer in use, kept for the next tree or the next positions of the same mesh: a system takes as
// long to hand out new memory as a refit or a copy takes to fill it. Snapshots may outlive each other in any order, on
// any thread: memory comes here when the last of those that use it lets it go.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <utility>

#include "core/aligned.h"
#include "math/ball.h"
#include "math/vec3.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

template <class T>
class SpareMemory {
 public:
  void give(T memory) noexcept {
    const std::lock_guard lock(mutex_);
    std::swap(memory_, memory);
  }
  // What was given last; empty if there is nothing.
  [[nodiscard]] T take() noexcept {
    const std::lock_guard lock(mutex_);
    return std::exchange(memory_, T{});
  }

 private:
  std::mutex mutex_;
  T memory_;
};

struct ShapedTree {
  WideBvh wide;
  std::uint64_t shape = 0;  // see new_tree_shape()
};

using SpareTree = SpareMemory<ShapedTree>;
// The positions of triangles' vertices, or balls.
struct Points {
  AlignedVector<Vec3f> positions;
  AlignedVector<Ball> balls;
};
using SparePositions = SpareMemory<Points>;

// A number for the shape of a wide tree: which nodes, leaves and triangles are where. Trees of the same number differ
// in boxes and positions alone. 0: unknown.
[[nodiscard]] inline std::uint64_t new_tree_shape() noexcept {
  static std::atomic<std::uint64_t> last{0};
  return last.fetch_add(1, std::memory_order_relaxed) + 1;
}

}  // namespace perfect_bvh
