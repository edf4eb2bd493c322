// Where a place on a surface is at another time within the shutter.
#pragma once

#include "tlas/instance.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// position: where the hit is in the world at time `from`. Of a triangle the place of the same u and v at time `to`;
// what is hit of a curve or a point goes with its axis.
[[nodiscard]] Vec3d moved_position(const Instance& instance, const Hit& hit, float from, float to,
                                   Vec3d position) noexcept;

}  // namespace perfect_bvh
