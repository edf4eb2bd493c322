// Sorting 64-bit items by some of their bits: least significant digit first, so stable.
// In: items, a scratch array of the same size. Out: the items in order, in one of the two arrays.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

namespace perfect_bvh {

// An integer in the order of floats: a < b exactly where the floats are. Of the two zeros the negative is first.
[[nodiscard]] inline std::uint32_t ordered_bits(float value) noexcept {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return bits ^ ((bits >> 31) != 0 ? 0xFFFFFFFFu : 0x80000000u);
}

// Sorts by bits [first_bit, first_bit + bit_count), 11 at a time. Returns where the result stands: items or scratch.
inline std::span<std::uint64_t> radix_sort(std::span<std::uint64_t> items, std::span<std::uint64_t> scratch,
                                           unsigned first_bit, unsigned bit_count) {
  constexpr unsigned kDigitBits = 11;
  constexpr std::size_t kMaxDigits = 3;
  using Histogram = std::array<std::uint32_t, 1u << kDigitBits>;
  const std::size_t digits = (bit_count + kDigitBits - 1) / kDigitBits;
  std::array<Histogram, kMaxDigits> histograms{};
  const auto digit_of = [&](std::uint64_t item, std::size_t digit) {
    const unsigned shift = static_cast<unsigned>(digit) * kDigitBits;
    const unsigned width = bit_count - shift < kDigitBits ? bit_count - shift : kDigitBits;
    return static_cast<std::size_t>((item >> (first_bit + shift)) & ((std::uint64_t{1} << width) - 1));
  };
  for (const std::uint64_t item : items) {
    for (std::size_t digit = 0; digit < digits; ++digit) ++histograms[digit][digit_of(item, digit)];
  }
  for (std::size_t digit = 0; digit < digits; ++digit) {
    Histogram& starts = histograms[digit];
    std::uint32_t start = 0;
    for (std::uint32_t& place : starts) start += std::exchange(place, start);
    for (const std::uint64_t item : items) scratch[starts[digit_of(item, digit)]++] = item;
    std::swap(items, scratch);
  }
  return items;
}

}  // namespace perfect_bvh
