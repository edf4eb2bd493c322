// Eight lanes in one 256-bit register: what AVX2 and AVX-512VL share. They differ in masks and in compression.
// Included by one translation unit only; everything in it has internal linkage.
#pragma once

#include <immintrin.h>

#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

using Float8 = __m256;
using Int8 = __m256i;

#define PERFECT_BVH_INLINE inline __attribute__((always_inline))

PERFECT_BVH_INLINE Float8 load(const float* p) noexcept { return _mm256_load_ps(p); }
PERFECT_BVH_INLINE Int8 load(const std::uint32_t* p) noexcept {
  return _mm256_load_si256(reinterpret_cast<const __m256i*>(p));
}
PERFECT_BVH_INLINE Float8 load_row(const void* base, std::size_t byte_offset) noexcept {
  return _mm256_load_ps(reinterpret_cast<const float*>(static_cast<const char*>(base) + byte_offset));
}
PERFECT_BVH_INLINE void store(float* p, Float8 a) noexcept { _mm256_store_ps(p, a); }
PERFECT_BVH_INLINE Float8 broadcast(const float& x) noexcept { return _mm256_broadcast_ss(&x); }
PERFECT_BVH_INLINE Float8 zero() noexcept { return _mm256_setzero_ps(); }
PERFECT_BVH_INLINE Float8 add(Float8 a, Float8 b) noexcept { return _mm256_add_ps(a, b); }
PERFECT_BVH_INLINE Float8 sub(Float8 a, Float8 b) noexcept { return _mm256_sub_ps(a, b); }
PERFECT_BVH_INLINE Float8 mul(Float8 a, Float8 b) noexcept { return _mm256_mul_ps(a, b); }
PERFECT_BVH_INLINE Float8 div(Float8 a, Float8 b) noexcept { return _mm256_div_ps(a, b); }
PERFECT_BVH_INLINE Float8 fmadd(Float8 a, Float8 b, Float8 c) noexcept { return _mm256_fmadd_ps(a, b, c); }
PERFECT_BVH_INLINE Float8 fmsub(Float8 a, Float8 b, Float8 c) noexcept { return _mm256_fmsub_ps(a, b, c); }
PERFECT_BVH_INLINE Float8 fnmadd(Float8 a, Float8 b, Float8 c) noexcept { return _mm256_fnmadd_ps(a, b, c); }
// Of two equal or unordered values, the second, as everywhere on x86.
PERFECT_BVH_INLINE Float8 min(Float8 a, Float8 b) noexcept { return _mm256_min_ps(a, b); }
PERFECT_BVH_INLINE Float8 max(Float8 a, Float8 b) noexcept { return _mm256_max_ps(a, b); }
PERFECT_BVH_INLINE Float8 abs(Float8 a) noexcept { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), a); }

// t where a ray meets eight planes across an axis; `inverse` and `offset` are those of a SlabRay: a fourth float behind
// the three may be read.
template <int kAxis>
PERFECT_BVH_INLINE Float8 plane_depths(Float8 planes, const float* inverse, const float* offset) noexcept {
  return fmsub(planes, broadcast(inverse[kAxis]), broadcast(offset[kAxis]));
}

PERFECT_BVH_INLINE unsigned count_bits(unsigned mask) noexcept { return static_cast<unsigned>(_mm_popcnt_u32(mask)); }

template <int kCount>
PERFECT_BVH_INLINE Int8 shift_right(Int8 a) noexcept {
  return _mm256_srli_epi32(a, kCount);
}
// Bits 10 kPlace to 10 kPlace + 9 of each word, as floats.
template <int kPlace>
PERFECT_BVH_INLINE Float8 ten_bits(Int8 words) noexcept {
  return _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(words, 10 * kPlace), _mm256_set1_epi32(0x3FF)));
}
PERFECT_BVH_INLINE Float8 load_small(const std::uint8_t* p) noexcept {
  return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p))));
}
// Lane i becomes a[index[i] & 7].
PERFECT_BVH_INLINE Float8 permute(Float8 a, Int8 index) noexcept { return _mm256_permutevar8x32_ps(a, index); }

}  // namespace
}  // namespace perfect_bvh
