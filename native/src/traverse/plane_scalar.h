// One triangle's plane in plain C++. The vector version gives the same t, bit for bit.
// Included by translation units of kernels only; everything in it has internal linkage.
#pragma once

#include "math/triangle.h"

namespace perfect_bvh {
namespace {

// `at(corner, axis)`: the corners' coordinates.
template <class Corners>
inline double meet_plane(const Corners& at, const double* origin, const double* direction) noexcept {
  const float a[3] = {at(0, 0), at(0, 1), at(0, 2)};
  const float b[3] = {at(1, 0), at(1, 1), at(1, 2)};
  const float c[3] = {at(2, 0), at(2, 1), at(2, 2)};
  return plane_t(plane_of(a, b, c), origin, direction);
}

}  // namespace
}  // namespace perfect_bvh
