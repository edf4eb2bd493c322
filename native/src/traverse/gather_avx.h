// Reads a leaf of the compact layout with AVX: each vertex by one load of four floats (the fourth is the next vertex's,
// or lies behind the last), eight of them turned into three rows. The gather instructions take more than twice as long.
// Included by each of the translation units that have AVX2; everything in it has internal linkage.
#pragma once

#include <immintrin.h>

#include "traverse/gathered_leaf.h"
#include "traverse/scene_view.h"

namespace perfect_bvh {
namespace {

inline __attribute__((always_inline)) __m256 load_two(const Vec3f& low, const Vec3f& high) noexcept {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(&low.x)), _mm_loadu_ps(&high.x), 1);
}

// `vertex(lane)` is the number of that triangle's corner.
template <class Vertex>
inline __attribute__((always_inline)) void gather_corner(float (*rows)[8], const IndexedLeaves& from, __m256 scale,
                                                         const Vertex& vertex) noexcept {
  const Vec3f* const positions = from.positions;
  const __m256 first = load_two(positions[vertex(0)], positions[vertex(4)]);
  const __m256 second = load_two(positions[vertex(1)], positions[vertex(5)]);
  const __m256 third = load_two(positions[vertex(2)], positions[vertex(6)]);
  const __m256 fourth = load_two(positions[vertex(3)], positions[vertex(7)]);
  const __m256 low_xy = _mm256_unpacklo_ps(first, second), high_xy = _mm256_unpacklo_ps(third, fourth);
  const __m256 low_z = _mm256_unpackhi_ps(first, second), high_z = _mm256_unpackhi_ps(third, fourth);
  _mm256_store_ps(rows[0], _mm256_mul_ps(_mm256_shuffle_ps(low_xy, high_xy, 0x44), scale));
  _mm256_store_ps(rows[1], _mm256_mul_ps(_mm256_shuffle_ps(low_xy, high_xy, 0xEE), scale));
  _mm256_store_ps(rows[2], _mm256_mul_ps(_mm256_shuffle_ps(low_z, high_z, 0x44), scale));
}

inline __attribute__((always_inline)) void gather_leaf(GatheredLeaf& leaf, const IndexedLeaves& from,
                                                       std::uint32_t row) noexcept {
  const std::uint32_t* const primitives = from.rows[row].primitives;
  const __m256 scale = _mm256_set1_ps(from.scale);
  _mm256_store_si256(reinterpret_cast<__m256i*>(leaf.primitives),
                     _mm256_load_si256(reinterpret_cast<const __m256i*>(primitives)));
  const Vec3<std::uint32_t>* const triangles = from.triangles;
  const auto first = [&](int lane) __attribute__((always_inline)) { return triangles[primitives[lane]].x; };
  const auto second = [&](int lane) __attribute__((always_inline)) { return triangles[primitives[lane]].y; };
  const auto third = [&](int lane) __attribute__((always_inline)) { return triangles[primitives[lane]].z; };
  gather_corner(leaf.corners[0], from, scale, first);
  gather_corner(leaf.corners[1], from, scale, second);
  gather_corner(leaf.corners[2], from, scale, third);
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
