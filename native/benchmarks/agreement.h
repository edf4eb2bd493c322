// Compares the answers of two engines: do they have the same triangle and the same t? Where two triangles meet at an
// edge or coincide, either answer is right: such answers are counted separately.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "traverse/ray.h"

namespace perfect_bvh::bench {

struct Agreement {
  std::size_t different = 0;       // one of the two a miss, or another t
  std::size_t other_triangle = 0;  // the same t, but another triangle or instance

  void add(const Agreement& other) noexcept { different += other.different, other_triangle += other.other_triangle; }
};

// t is the same within a relative error of 1e-5 or 1e-7 of the scene's diagonal.
[[nodiscard]] Agreement compare(std::span<const Hit> hits, std::span<const Hit> expected, double diagonal);
[[nodiscard]] Agreement compare(std::span<const std::uint8_t> occluded, std::span<const std::uint8_t> expected);

}  // namespace perfect_bvh::bench
