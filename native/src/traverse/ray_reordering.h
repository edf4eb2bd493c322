// Reorders rays so that consecutive coherent rays make compact packets (ray reordering: Boulos, Wald and Benthin 2008,
// "Adaptive ray packet reordering"). Images arrive row by row: 64 rays of a row are a strip of 64 x 1 pixels, which
// enters more nodes and leaves than a tile of 8 x 8, and for longer. Any order is valid, as answers do not depend on
// it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "traverse/kernel_table.h"

namespace perfect_bvh {

// The number of rays reordered at a time: eight rows of an image, and few enough for the second level cache.
inline constexpr std::size_t kReorderedRays = std::size_t{1} << 14;
// Fewer rays are not reordered.
inline constexpr std::size_t kLeastReordered = 1024;

struct ReorderingSpace {
  std::uint32_t order[kReorderedRays];
  std::uint16_t cells[kReorderedRays];
  std::uint32_t firsts[kReorderedRays / 8 + 1];
};

// Reorders up to kReorderedRays rays. Returns true if they begin or end near one point or are parallel, and are not in
// compact groups yet; space.order then has their rows. `reach` is the scene's, in the rays' units. The decision depends
// only on the rays.
[[nodiscard]] bool reorder_rays(std::span<const Ray> rays, double reach, ReorderingSpace& space) noexcept;

}  // namespace perfect_bvh
