// Reads a leaf of the compact layout with NEON: each vertex by one load of four floats (the fourth is the next
// vertex's, or lies behind the last), four of them turned into three rows. Included by one translation unit only;
// everything in it has internal linkage.
#pragma once

#include <arm_neon.h>

#include "traverse/gathered_leaf.h"
#include "traverse/scene_view.h"

namespace perfect_bvh {
namespace {

// Of four triangles. `vertex(lane)` is the number of that triangle's corner.
template <class Vertex>
inline __attribute__((always_inline)) void gather_corner(float (*rows)[8], int first_lane, const IndexedLeaves& from,
                                                         const Vertex& vertex) noexcept {
  const auto load_vertex = [&](int lane) __attribute__((always_inline)) {
    return vld1q_f32(&from.positions[vertex(first_lane + lane)].x);
  };
  const float32x4_t first = load_vertex(0), second = load_vertex(1), third = load_vertex(2), fourth = load_vertex(3);
  const float32x4_t odd_xy = vzip1q_f32(first, third), even_xy = vzip1q_f32(second, fourth);
  const float32x4_t odd_z = vzip2q_f32(first, third), even_z = vzip2q_f32(second, fourth);
  vst1q_f32(rows[0] + first_lane, vzip1q_f32(odd_xy, even_xy));
  vst1q_f32(rows[1] + first_lane, vzip2q_f32(odd_xy, even_xy));
  vst1q_f32(rows[2] + first_lane, vzip1q_f32(odd_z, even_z));
}

inline __attribute__((always_inline)) void gather_leaf(GatheredLeaf& leaf, const IndexedLeaves& from,
                                                       std::uint32_t row) noexcept {
  const std::uint32_t* const primitives = from.rows[row].primitives;
  vst1q_u32(leaf.primitives, vld1q_u32(primitives));
  vst1q_u32(leaf.primitives + 4, vld1q_u32(primitives + 4));
  const Vec3<std::uint32_t>* const triangles = from.triangles;
  const auto first = [&](int lane) __attribute__((always_inline)) { return triangles[primitives[lane]].x; };
  const auto second = [&](int lane) __attribute__((always_inline)) { return triangles[primitives[lane]].y; };
  const auto third = [&](int lane) __attribute__((always_inline)) { return triangles[primitives[lane]].z; };
  for (int lane = 0; lane < 8; lane += 4) {
    gather_corner(leaf.corners[0], lane, from, first);
    gather_corner(leaf.corners[1], lane, from, second);
    gather_corner(leaf.corners[2], lane, from, third);
  }
  if (from.scale == 1.0f) return;  // nearly all are
  for (auto& corner : leaf.corners) {
    for (float* const axis : corner) {
      vst1q_f32(axis, vmulq_n_f32(vld1q_f32(axis), from.scale));
      vst1q_f32(axis + 4, vmulq_n_f32(vld1q_f32(axis + 4), from.scale));
    }
  }
}

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
