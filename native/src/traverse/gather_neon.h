// Reads balls with NEON: each by one load of four floats, four of them turned into four rows. Included by one
// translation unit only; everything in it has internal linkage.
#pragma once

#include <arm_neon.h>

#include "traverse/gathered_balls.h"
#include "traverse/scene_view.h"

namespace perfect_bvh {
namespace {

// `ball(lane)` is the ball of that lane.
template <class BallOf>
inline __attribute__((always_inline)) void gather_balls(float (*rows)[8], float scale, const BallOf& ball) noexcept {
  for (int lane = 0; lane < 8; lane += 4) {
    const float32x4_t first = vld1q_f32(&ball(lane).centre.x), second = vld1q_f32(&ball(lane + 1).centre.x);
    const float32x4_t third = vld1q_f32(&ball(lane + 2).centre.x), fourth = vld1q_f32(&ball(lane + 3).centre.x);
    const float32x4_t odd_xy = vzip1q_f32(first, third), even_xy = vzip1q_f32(second, fourth);
    const float32x4_t odd_zr = vzip2q_f32(first, third), even_zr = vzip2q_f32(second, fourth);
    vst1q_f32(rows[0] + lane, vmulq_n_f32(vzip1q_f32(odd_xy, even_xy), scale));
    vst1q_f32(rows[1] + lane, vmulq_n_f32(vzip2q_f32(odd_xy, even_xy), scale));
    vst1q_f32(rows[2] + lane, vmulq_n_f32(vzip1q_f32(odd_zr, even_zr), scale));
    vst1q_f32(rows[3] + lane, vmulq_n_f32(vzip2q_f32(odd_zr, even_zr), scale));
  }
}

}  // namespace
}  // namespace perfect_bvh
