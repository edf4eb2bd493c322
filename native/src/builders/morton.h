// Morton codes: the interleaved bits of three coordinates, so that points with similar codes are near each other
// (Morton 1966; Lauterbach et al. 2009, "Fast BVH construction on GPUs").
// In: boxes. Out: a code of 30 bits for the centre of each.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/float4.h"

namespace perfect_bvh {

inline constexpr unsigned kMortonBits = 30;

// In each lane, moves bit i of a 10-bit number to bit 3 * i.
[[nodiscard]] inline Int4 spread_bits(Int4 x) noexcept {
  x = (x | (x << 16)) & Int4(0x030000FF);
  x = (x | (x << 8)) & Int4(0x0300F00F);
  x = (x | (x << 4)) & Int4(0x030C30C3);
  return (x | (x << 2)) & Int4(0x09249249);
}

// A cubic grid over the centres. Its cells are cubes, because the codes then divide longer axes first.
class MortonGrid {
 public:
  static constexpr float kCells = 1024.0f;

  // `centers` contains the center() of every box.
  explicit MortonGrid(const Box4& centers) noexcept {
    const auto lower = lanes(centers.lower), upper = lanes(centers.upper);
    float largest = 0.0f, extent = 0.0f;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      largest = std::max({largest, std::abs(lower[axis]), std::abs(upper[axis])});
    }
    // A power of two that brings coordinates near 1, so that no difference between them overflows or underflows.
    const int exponent = largest > 0.0f ? std::clamp(-std::ilogb(largest), -126, 127) : 0;
    multiplier_ = Float4(std::ldexp(1.0f, exponent));
    origin_ = centers.lower * multiplier_;
    const auto extents = lanes(centers.upper * multiplier_ - origin_);
    for (std::size_t axis = 0; axis < 3; ++axis) extent = std::max(extent, extents[axis]);
    scale_ = Float4(extent > kLeastExtent ? kCells / extent : 0.0f);
  }

  // Adds halves, because the sum of two large coordinates could overflow.
  [[nodiscard]] static Float4 center(const Box4& box) noexcept {
    const Float4 half(0.5f);
    return (box.lower.xyz0() * half) + (box.upper.xyz0() * half);
  }

  [[nodiscard]] std::uint32_t code(Float4 center) const noexcept {
    const Float4 place = (center * multiplier_ - origin_) * scale_;
    alignas(16) std::array<std::uint32_t, 4> cell;
    spread_bits(truncate(min(max(place, Float4(0.0f)), Float4(kCells - 1.0f)))).store(cell.data());
    return cell[0] << 2 | cell[1] << 1 | cell[2];
  }

 private:
  static constexpr float kLeastExtent = 0x1p-100f;

  [[nodiscard]] static std::array<float, 4> lanes(Float4 v) noexcept {
    alignas(16) std::array<float, 4> result;
    v.store(result.data());
    return result;
  }

  Float4 multiplier_, origin_, scale_;
};

// Radix sort ----------------------------------------------------------------------------------------------------------
// Sorts 64-bit items by some of their bits, least significant digit first, so the sort is stable.
// In: items, a scratch array of the same size. Out: the sorted items, in one of the two arrays. The result is the same
// for any number of threads, since there is only one stable order.

// Returns an integer in the order of floats: a < b exactly if the floats are. Of the two zeros the negative comes
// first.
[[nodiscard]] inline std::uint32_t ordered_bits(float value) noexcept {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return bits ^ ((bits >> 31) != 0 ? 0xFFFFFFFFu : 0x80000000u);
}

// Sorts by bits [first_bit, first_bit + bit_count), at most 33, up to 11 at a time. Returns the array with the result:
// items or scratch.
std::span<std::uint64_t> radix_sort(std::span<std::uint64_t> items, std::span<std::uint64_t> scratch,
                                    unsigned first_bit, unsigned bit_count, CancelToken& cancel);
// The same, divided among the pool's threads.
std::span<std::uint64_t> radix_sort(std::span<std::uint64_t> items, std::span<std::uint64_t> scratch,
                                    unsigned first_bit, unsigned bit_count, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
