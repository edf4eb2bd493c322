#include <algorithm>

#include "core/aligned.h"

namespace perfect_bvh {

void* Scratch::take_bytes(std::size_t bytes) {
  const std::size_t whole = whole_lines(bytes);
  if (blocks_.empty() || blocks_.back().size() - used_ < whole) {
    constexpr std::size_t kLeastSize = std::size_t{1} << 14;
    blocks_.emplace_back(whole_pages(std::max({whole, next_size_, kLeastSize})));
    next_size_ = 0;
    used_ = 0;
  }
  void* const part = blocks_.back().data() + used_;
  used_ += whole;
  return part;
}

}  // namespace perfect_bvh
