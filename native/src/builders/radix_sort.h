// Sorting 64-bit items by some of their bits: least significant digit first, so stable.
// In: items, a scratch array of the same size. Out: the items in order, in one of the two arrays: the same for any
// number of threads, since there is only one stable order.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// An integer in the order of floats: a < b exactly where the floats are. Of the two zeros the negative is first.
[[nodiscard]] inline std::uint32_t ordered_bits(float value) noexcept {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return bits ^ ((bits >> 31) != 0 ? 0xFFFFFFFFu : 0x80000000u);
}

// Sorts by bits [first_bit, first_bit + bit_count), at most 33, up to 11 at a time. Returns where the result stands:
// items or scratch.
std::span<std::uint64_t> radix_sort(std::span<std::uint64_t> items, std::span<std::uint64_t> scratch,
                                    unsigned first_bit, unsigned bit_count, CancelToken& cancel);
// The same, shared out over the pool's threads.
std::span<std::uint64_t> radix_sort(std::span<std::uint64_t> items, std::span<std::uint64_t> scratch,
                                    unsigned first_bit, unsigned bit_count, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
