// Memory for one piece of work, handed out in parts and given back all at once. New memory costs more than most work on
// it, page by page: parts that stand together share huge pages where each alone would be too small for one.
#pragma once

#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

#include "core/aligned.h"

namespace perfect_bvh {

class Scratch {
 public:
  Scratch() = default;
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  // So many bytes in all are about to be taken; it may be more.
  void expect(std::size_t bytes) noexcept { next_size_ = bytes + bytes / 64 + 64 * kCacheLine; }
  // Not initialised, on a cache line, kReadableBehind. Not for several threads at once. Throws bad_alloc.
  template <class T>
  [[nodiscard]] std::span<T> take(std::size_t count) {
    static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= kCacheLine);
    return {static_cast<T*>(take_bytes(count * sizeof(T))), count};
  }
  // Takes back what lies behind the first `count` items of the part that was taken last.
  template <class T>
  void trim(std::span<T> last, std::size_t count) noexcept {
    used_ -= whole_lines(last.size_bytes()) - whole_lines(count * sizeof(T));
  }

 private:
  // Parts end on cache lines.
  [[nodiscard]] static std::size_t whole_lines(std::size_t bytes) noexcept {
    return (bytes + kCacheLine - 1) / kCacheLine * kCacheLine;
  }
  [[nodiscard]] void* take_bytes(std::size_t bytes);

  std::vector<AlignedVector<std::byte>> blocks_;  // parts are cut from the last
  std::size_t next_size_ = 0;
  std::size_t used_ = 0;
};

}  // namespace perfect_bvh
