// What a builder knows of a primitive: its box and its number.
#pragma once

#include <cstdint>

#include "math/aabb.h"

namespace perfect_bvh {

struct alignas(16) PrimRef {
  Vec3f lower;
  std::uint32_t prim_index;
  Vec3f upper;
  std::uint32_t unused = 0;

  [[nodiscard]] constexpr Aabb box() const noexcept { return {lower, upper}; }
  // Twice the centre: the factor is never needed.
  [[nodiscard]] constexpr Vec3f doubled_centroid() const noexcept { return lower + upper; }
};
static_assert(sizeof(PrimRef) == 32);

}  // namespace perfect_bvh
