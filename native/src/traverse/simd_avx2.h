// Eight lanes with AVX2 and FMA. Masks are vectors; compression is a permutation from a table.
// Included by one translation unit only; everything in it has internal linkage.
#pragma once

#include "traverse/simd_avx.h"

namespace perfect_bvh {
namespace {

using Mask8 = __m256;

PERFECT_BVH_INLINE Mask8 less_equal(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps(a, b, _CMP_LE_OQ); }
PERFECT_BVH_INLINE Mask8 less(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps(a, b, _CMP_LT_OQ); }
PERFECT_BVH_INLINE Mask8 not_equal(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps(a, b, _CMP_NEQ_OQ); }
PERFECT_BVH_INLINE Mask8 both(Mask8 a, Mask8 b) noexcept { return _mm256_and_ps(a, b); }
PERFECT_BVH_INLINE Mask8 either(Mask8 a, Mask8 b) noexcept { return _mm256_or_ps(a, b); }
PERFECT_BVH_INLINE unsigned bits(Mask8 mask) noexcept { return static_cast<unsigned>(_mm256_movemask_ps(mask)); }

// Row m: the lanes that m names, in order, a byte each; the rest is 0.
struct CompressTable {
  std::uint64_t rows[256];
  constexpr CompressTable() noexcept : rows{} {
    for (unsigned mask = 0; mask < 256; ++mask) {
      unsigned place = 0;
      for (unsigned lane = 0; lane < 8; ++lane) {
        if (mask & (1u << lane)) rows[mask] |= static_cast<std::uint64_t>(lane) << (8 * place++);
      }
    }
  }
};
constexpr CompressTable kCompress;

PERFECT_BVH_INLINE Int8 compressing(unsigned mask) noexcept {
  return _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(&kCompress.rows[mask])));
}

// Writes the children in `hit` to `children` (all 8 places may be overwritten), the farthest first, and where each
// is entered to `nears`. Returns how many they are.
PERFECT_BVH_INLINE unsigned push_sorted(const WideNode& node, std::uint32_t order_shift, Mask8 hit, Float8 near,
                                        std::uint32_t* children, float* nears) noexcept {
  const Int8 order = _mm256_srlv_epi32(load(node.order), _mm256_set1_epi32(static_cast<int>(order_shift)));
  const unsigned kept = bits(permute(hit, order));
  const Int8 places = _mm256_permutevar8x32_epi32(order, compressing(kept));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(children), _mm256_permutevar8x32_epi32(load(node.child), places));
  _mm256_storeu_ps(nears, permute(near, places));
  return count_bits(bits(hit));
}
PERFECT_BVH_INLINE unsigned push_unsorted(const WideNode& node, Mask8 hit, std::uint32_t* children) noexcept {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(children),
                      _mm256_permutevar8x32_epi32(load(node.child), compressing(bits(hit))));
  return count_bits(bits(hit));
}
// Moves the first `count` (at most 8) entries whose `nears` do not exceed `limit` to the front of `to_*`, which may
// be the same place or lie before it; all 8 places there may be overwritten. Returns how many they are.
PERFECT_BVH_INLINE unsigned keep_near(const std::uint32_t* children, const float* nears, unsigned count, Float8 limit,
                                      std::uint32_t* to_children, float* to_nears) noexcept {
  const Float8 near = _mm256_loadu_ps(nears);
  const unsigned kept = _bzhi_u32(bits(less_equal(near, limit)), count);
  const Int8 places = compressing(kept);
  const Int8 child = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(children));
  _mm256_storeu_ps(to_nears, permute(near, places));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(to_children), _mm256_permutevar8x32_epi32(child, places));
  return count_bits(kept);
}

}  // namespace
}  // namespace perfect_bvh
