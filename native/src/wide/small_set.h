// A set of up to 8 numbers in two registers. It decides whether triangles fit into a leaf, and which slot each of their
// vertices takes there.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "builders/bvh2.h"
#include "math/float4.h"

namespace perfect_bvh {

class SmallSet {
 public:
  static constexpr std::uint32_t kMost = 8;

  // The count of numbers added. If it is more than kMost, they did not fit and the set must not be used further.
  [[nodiscard]] std::uint32_t count() const noexcept { return count_; }
  [[nodiscard]] bool overflows() const noexcept { return count_ > kMost; }

  // Adds a number below 2^31. Returns its slot: slots follow the order of insertion.
  std::uint32_t add(std::uint32_t number) noexcept { return add_stored(stored_form(number)); }
  // Adds three at once, in a third of the time of three calls. Inlined, so that a loop keeps the set in registers.
  [[gnu::always_inline]] std::array<std::uint32_t, 3> add(std::uint32_t a, std::uint32_t b, std::uint32_t c) noexcept {
    const Int4 all_a(stored_form(a)), all_b(stored_form(b)), all_c(stored_form(c));
    const std::uint32_t found_a = find(all_a), found_b = find(all_b), found_c = find(all_c);
    const std::uint32_t place_a = count_;
    const std::uint32_t place_b = place_a + (found_a == 0 ? 1 : 0);
    const bool is_new_b = (found_b == 0) & (b != a);
    const std::uint32_t place_c = place_b + (is_new_b ? 1 : 0);
    const bool is_new_c = (found_c == 0) & (c != a) & (c != b);
    count_ = place_c + (is_new_c ? 1 : 0);
    const Place& row_a = kPlaces[row_of(found_a == 0, place_a)];
    const Place& row_b = kPlaces[row_of(is_new_b, place_b)];
    const Place& row_c = kPlaces[row_of(is_new_c, place_c)];
    low_ = low_ | ((all_a & row_a.low()) | ((all_b & row_b.low()) | (all_c & row_c.low())));
    high_ = high_ | ((all_a & row_a.high()) | ((all_b & row_b.high()) | (all_c & row_c.high())));
    const std::uint32_t at_a = first_of(found_a, place_a);
    const std::uint32_t at_b = b == a ? at_a : first_of(found_b, place_b);
    return {at_a, at_b, c == a ? at_a : c == b ? at_b : first_of(found_c, place_c)};
  }
  void add(const SmallSet& other) noexcept {
    alignas(16) std::array<std::int32_t, kMost> stored;
    other.low_.store(&stored[0]);
    other.high_.store(&stored[4]);
    const std::uint32_t count = other.count_ < kMost ? other.count_ : kMost;
    for (std::uint32_t i = 0; i < count; ++i) add_stored(stored[i]);
    if (other.overflows()) count_ = kMost + 1;
  }
  // Returns the numbers in order of insertion. Slots past count() repeat the last number. The set must not be empty.
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

    [[nodiscard]] Int4 low() const noexcept { return Int4::load(&lanes[0]); }
    [[nodiscard]] Int4 high() const noexcept { return Int4::load(&lanes[4]); }
  };
  // Row i has all bits of lane i; row 8 has none.
  static constexpr Place kPlaces[kMost + 1] = {
      {{-1, 0, 0, 0, 0, 0, 0, 0}}, {{0, -1, 0, 0, 0, 0, 0, 0}}, {{0, 0, -1, 0, 0, 0, 0, 0}},
      {{0, 0, 0, -1, 0, 0, 0, 0}}, {{0, 0, 0, 0, -1, 0, 0, 0}}, {{0, 0, 0, 0, 0, -1, 0, 0}},
      {{0, 0, 0, 0, 0, 0, -1, 0}}, {{0, 0, 0, 0, 0, 0, 0, -1}}, {{0, 0, 0, 0, 0, 0, 0, 0}}};

  // Numbers are stored plus one: 0 marks an empty slot.
  [[nodiscard]] static std::int32_t stored_form(std::uint32_t number) noexcept {
    return static_cast<std::int32_t>(number + 1);
  }
  [[nodiscard]] static std::uint32_t row_of(bool is_new, std::uint32_t place) noexcept {
    return is_new && place < kMost ? place : kMost;
  }
  // Returns the slot where the number was found, or else the slot that it takes.
  [[nodiscard]] static std::uint32_t first_of(std::uint32_t found, std::uint32_t place) noexcept {
    return static_cast<std::uint32_t>(std::countr_zero(found | 1u << (place < kMost ? place : kMost)));
  }
  [[nodiscard]] std::uint32_t find(Int4 all) const noexcept {
    return equal_lanes(low_, all) | equal_lanes(high_, all) << 4;
  }

  std::uint32_t add_stored(std::int32_t stored) noexcept {
    const Int4 all(stored);
    const std::uint32_t found = find(all);
    const Place& row = kPlaces[row_of(found == 0, count_)];
    low_ = low_ | (all & row.low());
    high_ = high_ | (all & row.high());
    const std::uint32_t place = first_of(found, count_);
    count_ += found == 0 ? 1 : 0;
    return place;
  }

  Int4 low_{0}, high_{0};
  std::uint32_t count_ = 0;
};

// Subtree range -------------------------------------------------------------------------------------------------------
// The range of a subtree in its tree's array. In depth-first order the pairs of children below a node follow each other
// without a gap. So the sizes of subtrees are known without a walk, and each subtree is an independent task.

struct SubtreeRange {
  std::uint32_t node;
  std::uint32_t end;  // one past the last node below; undefined for a leaf
};

[[nodiscard]] inline SubtreeRange whole_range(const Bvh2& tree) noexcept {
  return {0, static_cast<std::uint32_t>(tree.nodes.size())};
}
[[nodiscard]] inline SubtreeRange left_range(const Bvh2& tree, SubtreeRange range) noexcept {
  const std::uint32_t pair = tree.nodes[range.node].first;
  const Bvh2Node& right = tree.nodes[pair + 1];
  return {pair, right.is_leaf() ? range.end : right.first};
}
[[nodiscard]] inline SubtreeRange right_range(const Bvh2& tree, SubtreeRange range) noexcept {
  return {tree.nodes[range.node].first + 1, range.end};
}
// Returns the number of nodes below.
[[nodiscard]] inline std::uint32_t size_of(const Bvh2& tree, SubtreeRange range) noexcept {
  const Bvh2Node& node = tree.nodes[range.node];
  return node.is_leaf() ? 0 : range.end - node.first;
}

}  // namespace perfect_bvh
