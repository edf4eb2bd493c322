// The power of two that a tree's coordinates are stored times, so that products of them stay within the range of float.
#pragma once

#include <algorithm>
#include <cmath>

#include "math/aabb.h"
#include "math/slab.h"

namespace perfect_bvh {

[[nodiscard]] inline Vec3f magnitude_of(const Aabb& box) noexcept {
  return {larger(magnitude(box.lower.x), magnitude(box.upper.x)),
          larger(magnitude(box.lower.y), magnitude(box.upper.y)),
          larger(magnitude(box.lower.z), magnitude(box.upper.z))};
}

// 1 for ordinary coordinates; otherwise what brings the largest into [1, 2).
[[nodiscard]] inline float tree_scale(const Aabb& box) noexcept {
  const Vec3f size = magnitude_of(box);
  const float reach = std::max({size.x, size.y, size.z});
  if (!(reach > 0.0f) || (reach >= 0x1p-20f && reach <= 0x1p20f)) return 1.0f;
  // The power must be a normal number itself.
  return std::ldexp(1.0f, std::clamp(-std::ilogb(reach), -126, 126));
}

// Of a tree with this box, as stored times `scale`.
[[nodiscard]] inline TreeExtent tree_extent(const Aabb& box, float scale) noexcept {
  const Vec3f size = magnitude_of(box) * scale;
  return {{size.x, size.y, size.z}, std::max({size.x, size.y, size.z})};
}

}  // namespace perfect_bvh
