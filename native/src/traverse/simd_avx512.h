// Eight lanes with AVX-512VL: 256-bit vectors, mask registers, compression. (512-bit vectors were slower: they close a
// port and lower the clock.) Included by one translation unit only; everything in it has internal linkage.
#pragma once

#include "traverse/simd_avx.h"

namespace perfect_bvh {
namespace {

using Mask8 = __mmask8;

PERFECT_BVH_INLINE Mask8 less_equal(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps_mask(a, b, _CMP_LE_OQ); }
PERFECT_BVH_INLINE Mask8 less(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps_mask(a, b, _CMP_LT_OQ); }
PERFECT_BVH_INLINE Mask8 not_equal(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps_mask(a, b, _CMP_NEQ_OQ); }
PERFECT_BVH_INLINE Mask8 both(Mask8 a, Mask8 b) noexcept { return static_cast<Mask8>(a & b); }
PERFECT_BVH_INLINE Mask8 either(Mask8 a, Mask8 b) noexcept { return static_cast<Mask8>(a | b); }
PERFECT_BVH_INLINE unsigned bits(Mask8 mask) noexcept { return mask; }

// Writes the children in `hit` to `children` (all 8 places may be overwritten), the farthest first, and where each
// is entered to `nears`. Returns how many they are.
PERFECT_BVH_INLINE unsigned push_sorted(const WideNode& node, std::uint32_t order_shift, Mask8 hit, Float8 near,
                                        std::uint32_t* children, float* nears) noexcept {
  const Int8 order = _mm256_srlv_epi32(load(node.order), _mm256_set1_epi32(static_cast<int>(order_shift)));
  const Int8 child = _mm256_permutevar8x32_epi32(_mm256_maskz_load_epi32(hit, node.child), order);
  const Mask8 kept = _mm256_test_epi32_mask(child, child);  // a child is never 0
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(children), _mm256_maskz_compress_epi32(kept, child));
  _mm256_storeu_ps(nears, _mm256_maskz_compress_ps(kept, permute(near, order)));
  return count_bits(hit);
}
PERFECT_BVH_INLINE unsigned push_unsorted(const WideNode& node, Mask8 hit, std::uint32_t* children) noexcept {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(children), _mm256_maskz_compress_epi32(hit, load(node.child)));
  return count_bits(hit);
}
// Moves the first `count` (at most 8) entries whose `nears` do not exceed `limit` to the front of `to_*`, which may
// be the same place or lie before it; all 8 places there may be overwritten. Returns how many they are.
PERFECT_BVH_INLINE unsigned keep_near(const std::uint32_t* children, const float* nears, unsigned count, Float8 limit,
                                      std::uint32_t* to_children, float* to_nears) noexcept {
  const Float8 near = _mm256_loadu_ps(nears);
  const Mask8 kept = static_cast<Mask8>(_bzhi_u32(less_equal(near, limit), count));
  const Int8 child = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(children));
  _mm256_storeu_ps(to_nears, _mm256_maskz_compress_ps(kept, near));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(to_children), _mm256_maskz_compress_epi32(kept, child));
  return static_cast<unsigned>(_mm_popcnt_u32(kept));
}

}  // namespace
}  // namespace perfect_bvh
