// Dividing references on a grid in two: at a plane, or in halves.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "builders/grid_ref.h"
#include "builders/select_nth.h"
#include "core/cancel.h"

namespace perfect_bvh {

// By its doubled centroid.
[[nodiscard]] inline bool is_left_of(const GridRef& ref, std::uint32_t axis, std::int32_t border) noexcept {
  return ref.lower[axis] - ref.negated_upper[axis] < border;
}

// Copies what lies left of the border to `left` and on, the rest to `right` and back. Returns how many are left.
inline std::size_t partition(const GridRef* from, std::size_t count, std::uint32_t axis, std::int32_t border,
                             GridRef* left, GridRef* right) noexcept {
  const GridRef* const first_left = left;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_left = is_left_of(from[i], axis, border);
    Short8::load(&from[i]).store(is_left ? left : right);
    left += is_left;
    right -= !is_left;
  }
  return static_cast<std::size_t>(left - first_left);
}

// Brings the `half` references with the least centroids on an axis to the front; of equal ones those that come first
// in the input.
inline void put_least_first(std::span<GridRef> refs, std::uint32_t half, std::size_t axis, CancelToken& cancel) {
  const auto key = [axis](const GridRef& ref) {
    return std::pair(ref.lower[axis] - ref.negated_upper[axis], ref.position());
  };
  select_nth(refs, half, cancel, [&](const GridRef& a, const GridRef& b) { return key(a) < key(b); });
}

}  // namespace perfect_bvh
