// Cache-line aligned storage for trees and geometry.
#pragma once

#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

namespace perfect_bvh {

inline constexpr std::size_t kCacheLine = 64;

// This many bytes after the last element can be read, with undefined values, so that three floats can be loaded as a
// whole register.
inline constexpr std::size_t kReadableBehind = 16;

// Allocates memory aligned to a cache line. Large blocks use huge pages if the system has them (Linux, "madvise" or
// "always"). Random rays in a tree of 3 million triangles then rarely wait for address translation, and the system
// hands out memory in 512 times fewer steps. For the gain with a dragon of 3.2 million triangles, see aligned.cpp.
[[nodiscard]] void* allocate_aligned(std::size_t bytes);
// Returns the size to request instead of `bytes` for short-lived memory: whole huge pages, if it nearly fills one.
[[nodiscard]] std::size_t whole_pages(std::size_t bytes) noexcept;
// `bytes` must be the allocated size.
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
  // Elements that are about to be overwritten need not be cleared: `resize` leaves trivial types uninitialized, and
  // those that have a type `Overwritten`.
  template <class U>
  void construct([[maybe_unused]] U* place) noexcept {
    if constexpr (!requires { typename U::Overwritten; }) ::new (static_cast<void*>(place)) U;
  }
  template <class U, class... Args>
  void construct(U* place, Args&&... args) {
    ::new (static_cast<void*>(place)) U(static_cast<Args&&>(args)...);
  }
  friend bool operator==(const AlignedAllocator&, const AlignedAllocator&) noexcept { return true; }
};

// A vector aligned to a cache line. `resize(count)` does NOT initialize trivially constructible elements, nor those
// that have a type `Overwritten`.
template <class T>
using AlignedVector = std::vector<T, AlignedAllocator<T>>;

// Scratch -------------------------------------------------------------------------------------------------------------
// Memory for one operation, handed out in parts and released as a whole. New memory costs more than most work on it,
// page by page. Adjacent parts share huge pages for which each alone would be too small.

class Scratch {
 public:
  Scratch() = default;
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  // Announces the total number of bytes that will be taken; it may be exceeded.
  void expect(std::size_t bytes) noexcept { next_size_ = bytes + bytes / 64 + 64 * kCacheLine; }
  // Returns uninitialized memory, aligned to a cache line, with kReadableBehind. Not thread-safe. Throws bad_alloc.
  template <class T>
  [[nodiscard]] std::span<T> take(std::size_t count) {
    static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= kCacheLine);
    return {static_cast<T*>(take_bytes(count * sizeof(T))), count};
  }
  // Releases everything after the first `count` items of the part that was taken last.
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
