// Eight lanes with AVX-512VL: 256-bit vectors, mask registers, compression. (512-bit vectors were slower: they close a
// port and lower the clock.) Included by one translation unit only; everything in it has internal linkage.
#pragma once

#include <immintrin.h>

#include "traverse/isa_avx.h"

namespace perfect_bvh {
namespace {

using Mask8 = __mmask8;

PERFECT_BVH_INLINE Mask8 less_equal(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps_mask(a, b, _CMP_LE_OQ); }
PERFECT_BVH_INLINE Mask8 less(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps_mask(a, b, _CMP_LT_OQ); }
PERFECT_BVH_INLINE Mask8 not_equal(Float8 a, Float8 b) noexcept { return _mm256_cmp_ps_mask(a, b, _CMP_NEQ_OQ); }
PERFECT_BVH_INLINE Mask8 both(Mask8 a, Mask8 b) noexcept { return static_cast<Mask8>(a & b); }
PERFECT_BVH_INLINE Mask8 either(Mask8 a, Mask8 b) noexcept { return static_cast<Mask8>(a | b); }
PERFECT_BVH_INLINE unsigned bits(Mask8 mask) noexcept { return mask; }

// Writes the children in `hit` to `children` (all 8 entries may be overwritten), the farthest first, and their entry
// distances to `nears`. Returns their number.
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
// Moves the first `count` (at most 8) entries whose `nears` do not exceed `limit` to the front of `to_*`. That may be
// the same array or begin before it; all 8 entries there may be overwritten. Returns the number of entries kept.
PERFECT_BVH_INLINE unsigned keep_near(const std::uint32_t* children, const float* nears, unsigned count, Float8 limit,
                                      std::uint32_t* to_children, float* to_nears) noexcept {
  const Float8 near = _mm256_loadu_ps(nears);
  const Mask8 kept = static_cast<Mask8>(_bzhi_u32(less_equal(near, limit), count));
  const Int8 child = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(children));
  _mm256_storeu_ps(to_nears, _mm256_maskz_compress_ps(kept, near));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(to_children), _mm256_maskz_compress_epi32(kept, child));
  return static_cast<unsigned>(_mm_popcnt_u32(kept));
}

// Simd rays avx512 ----------------------------------------------------------------------------------------------------
// Sixteen rays per vector with AVX-512: 512-bit vectors, which double the work per cycle when every lane is in use.

constexpr unsigned kRayLanes = 16;
using RayFloat = __m512;
using RayMask = __mmask16;

PERFECT_BVH_INLINE RayFloat load_rays(const float* p) noexcept { return _mm512_load_ps(p); }
PERFECT_BVH_INLINE void store_rays(float* p, RayFloat a) noexcept { _mm512_store_ps(p, a); }
PERFECT_BVH_INLINE RayFloat every_ray(float x) noexcept { return _mm512_set1_ps(x); }
PERFECT_BVH_INLINE RayFloat add(RayFloat a, RayFloat b) noexcept { return _mm512_add_ps(a, b); }
PERFECT_BVH_INLINE RayFloat sub(RayFloat a, RayFloat b) noexcept { return _mm512_sub_ps(a, b); }
PERFECT_BVH_INLINE RayFloat mul(RayFloat a, RayFloat b) noexcept { return _mm512_mul_ps(a, b); }
PERFECT_BVH_INLINE RayFloat div(RayFloat a, RayFloat b) noexcept { return _mm512_div_ps(a, b); }
PERFECT_BVH_INLINE RayFloat fmadd(RayFloat a, RayFloat b, RayFloat c) noexcept { return _mm512_fmadd_ps(a, b, c); }
PERFECT_BVH_INLINE RayFloat fmsub(RayFloat a, RayFloat b, RayFloat c) noexcept { return _mm512_fmsub_ps(a, b, c); }
PERFECT_BVH_INLINE RayFloat fnmadd(RayFloat a, RayFloat b, RayFloat c) noexcept { return _mm512_fnmadd_ps(a, b, c); }
// Masked with all lanes: the unmasked forms start from an undefined vector, and GCC 12 warns about that.
constexpr RayMask kAllRays = 0xFFFF;
PERFECT_BVH_INLINE RayFloat min(RayFloat a, RayFloat b) noexcept { return _mm512_maskz_min_ps(kAllRays, a, b); }
PERFECT_BVH_INLINE RayFloat max(RayFloat a, RayFloat b) noexcept { return _mm512_maskz_max_ps(kAllRays, a, b); }
PERFECT_BVH_INLINE __m256 low_half(RayFloat a) noexcept { return _mm512_maskz_extractf32x8_ps(0xFF, a, 0); }
PERFECT_BVH_INLINE __m256 high_half(RayFloat a) noexcept { return _mm512_maskz_extractf32x8_ps(0xFF, a, 1); }
PERFECT_BVH_INLINE RayFloat abs(RayFloat a) noexcept { return _mm512_abs_ps(a); }

PERFECT_BVH_INLINE RayMask less_equal(RayFloat a, RayFloat b) noexcept { return _mm512_cmp_ps_mask(a, b, _CMP_LE_OQ); }
PERFECT_BVH_INLINE RayMask less(RayFloat a, RayFloat b) noexcept { return _mm512_cmp_ps_mask(a, b, _CMP_LT_OQ); }
PERFECT_BVH_INLINE RayMask not_equal(RayFloat a, RayFloat b) noexcept { return _mm512_cmp_ps_mask(a, b, _CMP_NEQ_OQ); }
PERFECT_BVH_INLINE RayMask both(RayMask a, RayMask b) noexcept { return static_cast<RayMask>(a & b); }
PERFECT_BVH_INLINE RayMask either(RayMask a, RayMask b) noexcept { return static_cast<RayMask>(a | b); }
PERFECT_BVH_INLINE unsigned bits(RayMask mask) noexcept { return mask; }
PERFECT_BVH_INLINE RayMask ray_mask(unsigned bits) noexcept { return static_cast<RayMask>(bits); }
// Returns the lanes of a where the mask is set, of b elsewhere.
PERFECT_BVH_INLINE RayFloat select(RayMask mask, RayFloat a, RayFloat b) noexcept {
  return _mm512_mask_blend_ps(mask, b, a);
}
// Returns the sign bits.
PERFECT_BVH_INLINE unsigned signs(RayFloat a) noexcept { return _mm512_movepi32_mask(_mm512_castps_si512(a)); }
PERFECT_BVH_INLINE RayFloat with_sign(RayFloat magnitude, RayFloat sign) noexcept {
  return _mm512_or_ps(magnitude, _mm512_and_ps(sign, _mm512_set1_ps(-0.0f)));
}

// A vector of doubles, for half as many rays.
using RayDouble = __m512d;
PERFECT_BVH_INLINE RayDouble load_rays(const double* p) noexcept { return _mm512_load_pd(p); }
PERFECT_BVH_INLINE void store_rays(double* p, RayDouble a) noexcept { _mm512_store_pd(p, a); }
PERFECT_BVH_INLINE RayDouble every_ray(double x) noexcept { return _mm512_set1_pd(x); }
PERFECT_BVH_INLINE RayDouble add(RayDouble a, RayDouble b) noexcept { return _mm512_add_pd(a, b); }
PERFECT_BVH_INLINE RayDouble sub(RayDouble a, RayDouble b) noexcept { return _mm512_sub_pd(a, b); }
PERFECT_BVH_INLINE RayDouble mul(RayDouble a, RayDouble b) noexcept { return _mm512_mul_pd(a, b); }
PERFECT_BVH_INLINE RayDouble div(RayDouble a, RayDouble b) noexcept { return _mm512_div_pd(a, b); }
PERFECT_BVH_INLINE unsigned magnitudes_up_to(RayDouble a, RayDouble limit) noexcept {
  return _mm512_cmp_pd_mask(_mm512_abs_pd(a), limit, _CMP_LE_OQ);
}
// Rounds each to the nearest float.
PERFECT_BVH_INLINE RayFloat load_narrowed(const double* p) noexcept {
  const __m256 low = _mm512_maskz_cvtpd_ps(0xFF, load_rays(p)), high = _mm512_maskz_cvtpd_ps(0xFF, load_rays(p + 8));
  return _mm512_maskz_insertf32x8(kAllRays, _mm512_maskz_broadcast_f32x8(kAllRays, low), high, 1);
}

// Writes only the lanes set in `mask`.
PERFECT_BVH_INLINE void store_some(float* p, RayMask mask, RayFloat a) noexcept { _mm512_mask_store_ps(p, mask, a); }
PERFECT_BVH_INLINE void store_some(std::uint32_t* p, RayMask mask, std::uint32_t a) noexcept {
  _mm512_mask_store_epi32(p, mask, _mm512_set1_epi32(static_cast<int>(a)));
}
PERFECT_BVH_INLINE void store_some(double* p, RayMask mask, RayFloat a) noexcept {
  _mm512_mask_store_pd(p, static_cast<__mmask8>(mask), _mm512_maskz_cvtps_pd(0xFF, low_half(a)));
  _mm512_mask_store_pd(p + 8, static_cast<__mmask8>(mask >> 8), _mm512_maskz_cvtps_pd(0xFF, high_half(a)));
}
PERFECT_BVH_INLINE float largest(RayFloat a) noexcept {
  const __m256 eight = max(low_half(a), high_half(a));
  const __m128 four = _mm_max_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps(eight, 1));
  const __m128 two = _mm_max_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_max_ss(two, _mm_movehdup_ps(two)));
}

// Like push_sorted; also writes `flags` + each child's slot in the node to `places`.
PERFECT_BVH_INLINE unsigned push_boxes(const WideNode& node, std::uint32_t order_shift, Mask8 hit, Float8 near,
                                       std::uint32_t flags, std::uint32_t* children, float* nears,
                                       std::uint32_t* places) noexcept {
  const Int8 order = _mm256_srlv_epi32(load(node.order), _mm256_set1_epi32(static_cast<int>(order_shift)));
  const Int8 child = _mm256_permutevar8x32_epi32(_mm256_maskz_load_epi32(hit, node.child), order);
  const Mask8 kept = _mm256_test_epi32_mask(child, child);
  const Int8 place =
      _mm256_or_si256(_mm256_and_si256(order, _mm256_set1_epi32(7)), _mm256_set1_epi32(static_cast<int>(flags)));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(children), _mm256_maskz_compress_epi32(kept, child));
  _mm256_storeu_ps(nears, _mm256_maskz_compress_ps(kept, permute(near, order)));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(places), _mm256_maskz_compress_epi32(kept, place));
  return count_bits(hit);
}

}  // namespace

}  // namespace perfect_bvh
