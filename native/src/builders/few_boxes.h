// How to split a handful of boxes: every way to halve up to four of them, every plane for up to eight. Most of a
// tree's nodes are that small, and bins would cost more there and find less. Subdivision ends here, too: no split is
// made that costs more than a leaf (lecture, "Termination"). In: boxes on a grid, the SAH's costs. Out: which of them
// go left.
#pragma once

#include <cstdint>

#include "builders/build_config.h"
#include "builders/grid_ref.h"

namespace perfect_bvh {

inline constexpr std::uint32_t kFewBoxes = 8;

// Bit i: box i goes left. 0: a leaf costs no more than the best split, or (only past max_leaf_size) no split gains
// anything. `count` is 2 to kFewBoxes; `area` is the half area of all.
[[nodiscard]] std::uint32_t split_few(const GridBox* boxes, std::uint32_t count, float area,
                                      const BuildConfig& config) noexcept;

}  // namespace perfect_bvh
