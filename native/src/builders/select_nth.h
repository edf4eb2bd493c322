// Selection (std::nth_element) that asks whether to stop while it works on many items. The same arrangement either way.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "core/steps.h"

namespace perfect_bvh {

// So many take a few milliseconds; of fewer comparisons are not counted.
inline constexpr std::size_t kMostSelectedUnasked = 131072;

// Puts the item that would stand in place `n` there, what is less before it and the rest behind. When stopped, throws
// Cancelled: what the items are then is of no use.
template <class Item, class Less>
void select_nth(std::span<Item> items, std::size_t n, CancelToken& cancel, const Less& less) {
  const auto nth = items.begin() + static_cast<std::ptrdiff_t>(n);
  if (items.size() <= kMostSelectedUnasked) return std::nth_element(items.begin(), nth, items.end(), less);
  Steps steps(cancel);
  std::nth_element(items.begin(), nth, items.end(), [&](const Item& a, const Item& b) {
    steps.step();
    return less(a, b);
  });
}

}  // namespace perfect_bvh
