// Cache-line aligned storage for trees and geometry.
#pragma once

#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

namespace perfect_bvh {

inline constexpr std::size_t kCacheLine = 64;

// So many bytes behind the last element may be read, whatever they hold: a register may be loaded with three floats.
inline constexpr std::size_t kReadableBehind = 16;

// Memory on a cache line. Large blocks stand on huge pages where the system has them (Linux, "madvise" or "always"):
// rays at random in a tree of 3 million triangles then seldom wait for an address to be translated, and memory is
// handed out page by page 512 times less often. What it gave a dragon of 3.2 million triangles: see aligned.cpp.
[[nodiscard]] void* allocate_aligned(std::size_t bytes);
// The size to ask for instead of `bytes` where memory is soon given back: whole huge pages, where it nearly fills one.
[[nodiscard]] std::size_t whole_pages(std::size_t bytes) noexcept;
// `bytes` as it was allocated.
void free_aligned(void* memory, std::size_t bytes) noexcept;

template <class T>
struct AlignedAllocator {
  using value_type = T;
  AlignedAllocator() noexcept = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) noexcept {}
  [[nodiscard]] T* allocate(std::size_t count) {
    return static_cast<T*>(allocate_aligned(count * sizeof(T) + kReadableBehind));
  }
  void deallocate(T* memory, std::size_t count) noexcept { free_aligned(memory, count * sizeof(T) + kReadableBehind); }
  // Elements that are about to be overwritten are not worth clearing: `resize` leaves trivial types uninitialised.
  template <class U>
  void construct(U* place) noexcept {
    ::new (static_cast<void*>(place)) U;
  }
  template <class U, class... Args>
  void construct(U* place, Args&&... args) {
    ::new (static_cast<void*>(place)) U(static_cast<Args&&>(args)...);
  }
  friend bool operator==(const AlignedAllocator&, const AlignedAllocator&) noexcept { return true; }
};

// A vector on a cache-line boundary. `resize(count)` does NOT initialise trivially constructible elements.
template <class T>
using AlignedVector = std::vector<T, AlignedAllocator<T>>;

// Scratch -------------------------------------------------------------------------------------------------------------
// Memory for one piece of work, handed out in parts and given back all at once. New memory costs more than most work on
// it, page by page: parts that stand together share huge pages where each alone would be too small for one.

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
