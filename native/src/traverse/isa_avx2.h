// Eight lanes with AVX2 and FMA. Masks are vectors; compression is a permutation from a table.
// Included by one translation unit only; everything in it has internal linkage.
#pragma once

#include <immintrin.h>

#include "traverse/isa_avx.h"

namespace perfect_bvh {
namespace {

using Mask8 = __m256;

PERFECT_BVH_INLINE Mask8 less_equal(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps(a, b, _CMP_LE_OQ); }
PERFECT_BVH_INLINE Mask8 less(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps(a, b, _CMP_LT_OQ); }
PERFECT_BVH_INLINE Mask8 not_equal(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps(a, b, _CMP_NEQ_OQ); }
PERFECT_BVH_INLINE Mask8 both(Mask8 a, Mask8 b) noexcept { return _mm256_and_ps(a, b); }
PERFECT_BVH_INLINE Mask8 either(Mask8 a, Mask8 b) noexcept { return _mm256_or_ps(a, b); }
PERFECT_BVH_INLINE unsigned bits(Mask8 mask) noexcept { return static_cast<unsigned>(_mm256_movemask_ps(mask)); }

// Row m: the lanes set in m, in order, one byte each; the rest is 0.
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

// Writes the children in `hit` to `children` (all 8 entries may be overwritten), the farthest first, and their entry
// distances to `nears`. Returns their number.
PERFECT_BVH_INLINE unsigned push_sorted(const WideNode& node, std::uint32_t order_shift, Mask8 hit, Float8 near,
                                        std::uint32_t* children, float* nears) noexcept {
  const Int8 order = _mm256_srlv_epi32(load(node.order), _mm256_set1_epi32(static_cast<int>(order_shift)));
  const unsigned kept = bits(permute(hit, order));
  const Int8 places = _mm256_permutevar8x32_epi32(order, compressing(kept));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(children), _mm256_permutevar8x32_epi32(load(node.child), places));
  _mm256_storeu_ps(nears, permute(near, places));
  return count_bits(kept);
}
PERFECT_BVH_INLINE unsigned push_unsorted(const WideNode& node, Mask8 hit, std::uint32_t* children) noexcept {
  const unsigned kept = bits(hit);
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(children),
                      _mm256_permutevar8x32_epi32(load(node.child), compressing(kept)));
  return count_bits(kept);
}
// Moves the first `count` (at most 8) entries whose `nears` do not exceed `limit` to the front of `to_*`. That may be
// the same array or begin before it; all 8 entries there may be overwritten. Returns the number of entries kept.
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

// Simd rays avx2 ------------------------------------------------------------------------------------------------------
// Eight rays per vector with AVX2, with the same arithmetic.

constexpr unsigned kRayLanes = 8;
using RayFloat = Float8;
using RayMask = Mask8;

PERFECT_BVH_INLINE RayFloat load_rays(const float* p) noexcept { return load(p); }
PERFECT_BVH_INLINE void store_rays(float* p, RayFloat a) noexcept { store(p, a); }
PERFECT_BVH_INLINE RayFloat every_ray(float x) noexcept { return _mm256_set1_ps(x); }
PERFECT_BVH_INLINE RayMask ray_mask(unsigned bits) noexcept {
  const __m256i place = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
  const __m256i found = _mm256_and_si256(_mm256_set1_epi32(static_cast<int>(bits)), place);
  return _mm256_castsi256_ps(_mm256_cmpeq_epi32(found, place));
}
// Returns the lanes of a where the mask is set, of b elsewhere.
PERFECT_BVH_INLINE RayFloat select(RayMask mask, RayFloat a, RayFloat b) noexcept {
  return _mm256_blendv_ps(b, a, mask);
}
// Returns the sign bits.
PERFECT_BVH_INLINE unsigned signs(RayFloat a) noexcept { return static_cast<unsigned>(_mm256_movemask_ps(a)); }
PERFECT_BVH_INLINE RayFloat with_sign(RayFloat magnitude, RayFloat sign) noexcept {
  return _mm256_or_ps(magnitude, _mm256_and_ps(sign, _mm256_set1_ps(-0.0f)));
}

// A vector of doubles, for half as many rays.
using RayDouble = __m256d;
PERFECT_BVH_INLINE RayDouble load_rays(const double* p) noexcept { return _mm256_load_pd(p); }
PERFECT_BVH_INLINE void store_rays(double* p, RayDouble a) noexcept { _mm256_store_pd(p, a); }
PERFECT_BVH_INLINE RayDouble every_ray(double x) noexcept { return _mm256_set1_pd(x); }
PERFECT_BVH_INLINE RayDouble add(RayDouble a, RayDouble b) noexcept { return _mm256_add_pd(a, b); }
PERFECT_BVH_INLINE RayDouble sub(RayDouble a, RayDouble b) noexcept { return _mm256_sub_pd(a, b); }
PERFECT_BVH_INLINE RayDouble mul(RayDouble a, RayDouble b) noexcept { return _mm256_mul_pd(a, b); }
PERFECT_BVH_INLINE RayDouble div(RayDouble a, RayDouble b) noexcept { return _mm256_div_pd(a, b); }
PERFECT_BVH_INLINE unsigned magnitudes_up_to(RayDouble a, RayDouble limit) noexcept {
  return static_cast<unsigned>(_mm256_movemask_pd(_mm256_cmp_pd(magnitudes(a), limit, _CMP_LE_OQ)));
}
// Rounds each to the nearest float.
PERFECT_BVH_INLINE RayFloat load_narrowed(const double* p) noexcept {
  return _mm256_set_m128(_mm256_cvtpd_ps(load_rays(p + 4)), _mm256_cvtpd_ps(load_rays(p)));
}

// Writes only the lanes set in `mask`.
PERFECT_BVH_INLINE void store_some(float* p, RayMask mask, RayFloat a) noexcept {
  _mm256_maskstore_ps(p, _mm256_castps_si256(mask), a);
}
PERFECT_BVH_INLINE void store_some(std::uint32_t* p, RayMask mask, std::uint32_t a) noexcept {
  _mm256_maskstore_epi32(reinterpret_cast<int*>(p), _mm256_castps_si256(mask), _mm256_set1_epi32(static_cast<int>(a)));
}
PERFECT_BVH_INLINE void store_some(double* p, RayMask mask, RayFloat a) noexcept {
  const __m256i lanes = _mm256_castps_si256(mask);
  const __m256i low = _mm256_cvtepi32_epi64(_mm256_castsi256_si128(lanes));
  const __m256i high = _mm256_cvtepi32_epi64(_mm256_extracti128_si256(lanes, 1));
  _mm256_maskstore_pd(p, low, _mm256_cvtps_pd(_mm256_castps256_ps128(a)));
  _mm256_maskstore_pd(p + 4, high, _mm256_cvtps_pd(_mm256_extractf128_ps(a, 1)));
}
PERFECT_BVH_INLINE float largest(RayFloat a) noexcept {
  const __m128 four = _mm_max_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
  const __m128 two = _mm_max_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_max_ss(two, _mm_movehdup_ps(two)));
}

// Like push_sorted; also writes `flags` + each child's slot in the node to `places`.
PERFECT_BVH_INLINE unsigned push_boxes(const WideNode& node, std::uint32_t order_shift, Mask8 hit, Float8 near,
                                       std::uint32_t flags, std::uint32_t* children, float* nears,
                                       std::uint32_t* places) noexcept {
  const Int8 order = _mm256_srlv_epi32(load(node.order), _mm256_set1_epi32(static_cast<int>(order_shift)));
  const unsigned kept = bits(permute(hit, order));
  const Int8 from = _mm256_permutevar8x32_epi32(order, compressing(kept));
  const Int8 place =
      _mm256_or_si256(_mm256_and_si256(from, _mm256_set1_epi32(7)), _mm256_set1_epi32(static_cast<int>(flags)));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(children), _mm256_permutevar8x32_epi32(load(node.child), from));
  _mm256_storeu_ps(nears, permute(near, from));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(places), place);
  return count_bits(bits(hit));
}

}  // namespace

}  // namespace perfect_bvh
