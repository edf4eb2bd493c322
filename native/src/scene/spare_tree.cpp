#include "scene/spare_tree.h"

#include <atomic>

namespace perfect_bvh {

std::uint64_t new_tree_shape() noexcept {
  static std::atomic<std::uint64_t> last{0};
  return last.fetch_add(1, std::memory_order_relaxed) + 1;
}

}  // namespace perfect_bvh
