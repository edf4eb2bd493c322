// Whether two engines answer alike: the same triangle and the same t. Which of two triangles that meet at an edge is
// hit, or of two that lie in one another, is a matter of taste: such answers are counted apart.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "traverse/ray.h"

namespace perfect_bvh::bench {

struct Agreement {
  std::size_t different = 0;       // a hit for a miss, or another t
  std::size_t other_triangle = 0;  // the same t, of another triangle or instance

  void add(const Agreement& other) noexcept { different += other.different, other_triangle += other.other_triangle; }
};

// t is the same within 1e-5 of itself or 1e-7 of the scene's diagonal.
[[nodiscard]] Agreement compare(std::span<const Hit> hits, std::span<const Hit> expected, double diagonal);
[[nodiscard]] Agreement compare(std::span<const std::uint8_t> occluded, std::span<const std::uint8_t> expected);

}  // namespace perfect_bvh::bench
