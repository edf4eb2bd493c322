// What a builder with spatial splits must know of primitives beyond their boxes: where a slice of one lies.
#pragma once

#include <cstdint>
#include <span>

#include "math/float4.h"

namespace perfect_bvh {

class PrimClipper {
 public:
  virtual ~PrimClipper() = default;

  // Cuts a primitive (by its PrimRef::prim_index) at the planes coordinate[axis] = planes[0] < planes[1] < ... and
  // writes planes.size() + 1 boxes: slices[k] contains every point of the primitive with planes[k - 1] <=
  // coordinate[axis] <= planes[k], both ends included (beyond the first and the last plane: all there is). A slice may
  // be larger than that; it is empty (lower > upper on some axis) only where there is no such point. The fourth lanes
  // may hold anything. Called from many threads at once.
  virtual void slice(std::uint32_t prim_index, int axis, std::span<const float> planes,
                     Box4* slices) const noexcept = 0;
};

}  // namespace perfect_bvh
