// Reads balls, in plain C++.
// Included by one translation unit only; everything in it has internal linkage.
#pragma once

#include "traverse/gathered_balls.h"
#include "traverse/scene_view.h"

namespace perfect_bvh {
namespace {

// `ball(lane)` is the ball of that lane.
template <class BallOf>
inline void gather_balls(float (*rows)[8], float scale, const BallOf& ball) noexcept {
  for (int lane = 0; lane < 8; ++lane) {
    const Ball& from = ball(lane);
    rows[0][lane] = from.centre.x * scale, rows[1][lane] = from.centre.y * scale;
    rows[2][lane] = from.centre.z * scale, rows[3][lane] = from.radius * scale;
  }
}

}  // namespace
}  // namespace perfect_bvh
