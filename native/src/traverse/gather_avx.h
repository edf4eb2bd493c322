// Reads balls with AVX: each by one load of four floats, eight of them turned into four rows. The gather instructions
// take more than twice as long.
// Included by each of the translation units that have AVX2; everything in it has internal linkage.
#pragma once

#include <immintrin.h>

#include "traverse/gathered_balls.h"
#include "traverse/scene_view.h"

namespace perfect_bvh {
namespace {

inline __attribute__((always_inline)) __m256 load_two(const Vec3f& low, const Vec3f& high) noexcept {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(&low.x)), _mm_loadu_ps(&high.x), 1);
}

// `ball(lane)` is the ball of that lane.
template <class BallOf>
inline __attribute__((always_inline)) void gather_balls(float (*rows)[8], float scale, const BallOf& ball) noexcept {
  const __m256 factor = _mm256_set1_ps(scale);
  const auto load_balls = [&](int lane) __attribute__((always_inline)) {
    return load_two(ball(lane).centre, ball(lane + 4).centre);
  };
  const __m256 first = load_balls(0), second = load_balls(1), third = load_balls(2), fourth = load_balls(3);
  const __m256 low_xy = _mm256_unpacklo_ps(first, second), high_xy = _mm256_unpacklo_ps(third, fourth);
  const __m256 low_zr = _mm256_unpackhi_ps(first, second), high_zr = _mm256_unpackhi_ps(third, fourth);
  _mm256_store_ps(rows[0], _mm256_mul_ps(_mm256_shuffle_ps(low_xy, high_xy, 0x44), factor));
  _mm256_store_ps(rows[1], _mm256_mul_ps(_mm256_shuffle_ps(low_xy, high_xy, 0xEE), factor));
  _mm256_store_ps(rows[2], _mm256_mul_ps(_mm256_shuffle_ps(low_zr, high_zr, 0x44), factor));
  _mm256_store_ps(rows[3], _mm256_mul_ps(_mm256_shuffle_ps(low_zr, high_zr, 0xEE), factor));
}

}  // namespace
}  // namespace perfect_bvh
