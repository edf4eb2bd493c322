// A set of up to 8 numbers in two registers: what decides whether triangles fit into a leaf, and which place each of
// their vertices takes there.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "math/float4.h"

namespace perfect_bvh {

class SmallSet {
 public:
  static constexpr std::uint32_t kMost = 8;

  // Numbers that were added; more than kMost: they did not fit, and the set is of no more use.
  [[nodiscard]] std::uint32_t count() const noexcept { return count_; }
  [[nodiscard]] bool overflows() const noexcept { return count_ > kMost; }

  // Numbers below 2^31. Returns the place of the number in the order of their coming.
  std::uint32_t add(std::uint32_t number) noexcept { return add_stored(static_cast<std::int32_t>(number + 1)); }
  void add(const SmallSet& other) noexcept {
    alignas(16) std::array<std::int32_t, kMost> stored;
    other.low_.store(&stored[0]);
    other.high_.store(&stored[4]);
    const std::uint32_t count = other.count_ < kMost ? other.count_ : kMost;
    for (std::uint32_t i = 0; i < count; ++i) add_stored(stored[i]);
    if (other.overflows()) count_ = kMost + 1;
  }
  // In the order of their coming; the places past count() repeat the last number. Not of an empty set.
  [[nodiscard]] std::array<std::uint32_t, kMost> numbers() const noexcept {
    alignas(16) std::array<std::int32_t, kMost> stored;
    low_.store(&stored[0]);
    high_.store(&stored[4]);
    std::array<std::uint32_t, kMost> result;
    for (std::uint32_t i = 0; i < kMost; ++i) {
      result[i] = static_cast<std::uint32_t>(stored[i < count_ ? i : count_ - 1]) - 1;
    }
    return result;
  }

 private:
  struct alignas(16) Place {
    std::int32_t lanes[8];
  };
  // Row i: all bits of lane i; row 8: none.
  static constexpr Place kPlaces[kMost + 1] = {
      {{-1, 0, 0, 0, 0, 0, 0, 0}}, {{0, -1, 0, 0, 0, 0, 0, 0}}, {{0, 0, -1, 0, 0, 0, 0, 0}},
      {{0, 0, 0, -1, 0, 0, 0, 0}}, {{0, 0, 0, 0, -1, 0, 0, 0}}, {{0, 0, 0, 0, 0, -1, 0, 0}},
      {{0, 0, 0, 0, 0, 0, -1, 0}}, {{0, 0, 0, 0, 0, 0, 0, -1}}, {{0, 0, 0, 0, 0, 0, 0, 0}}};

  // Numbers are stored plus one: 0 is an empty place.
  std::uint32_t add_stored(std::int32_t stored) noexcept {
    const Int4 all(stored);
    const std::uint32_t found = equal_lanes(low_, all) | equal_lanes(high_, all) << 4;
    const std::uint32_t next = count_ < kMost ? count_ : kMost;
    const std::uint32_t row = found != 0 ? kMost : next;
    low_ = low_ | (all & Int4::load(&kPlaces[row].lanes[0]));
    high_ = high_ | (all & Int4::load(&kPlaces[row].lanes[4]));
    count_ += found == 0 ? 1 : 0;
    return static_cast<std::uint32_t>(std::countr_zero(found | 1u << next));
  }

  Int4 low_{0}, high_{0};
  std::uint32_t count_ = 0;
};

}  // namespace perfect_bvh
