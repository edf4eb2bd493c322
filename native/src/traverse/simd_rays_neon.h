// Eight rays in two registers with NEON: the arithmetic is that of simd_neon.h.
// Included by one translation unit only, after simd_neon.h; everything in it has internal linkage.
#pragma once

#include <arm_neon.h>

#include "traverse/simd_neon.h"

namespace perfect_bvh {
namespace {

constexpr unsigned kRayLanes = 8;
using RayFloat = Float8;
using RayMask = Mask8;

PERFECT_BVH_INLINE RayFloat load_rays(const float* p) noexcept { return load(p); }
PERFECT_BVH_INLINE void store_rays(float* p, const RayFloat& a) noexcept { store(p, a); }
PERFECT_BVH_INLINE RayFloat every_ray(float x) noexcept { return broadcast(x); }

alignas(16) constexpr std::uint32_t kBitOfRay[8] = {1, 2, 4, 8, 16, 32, 64, 128};
PERFECT_BVH_INLINE RayMask ray_mask(unsigned bits) noexcept {
  const uint32x4_t all = vdupq_n_u32(bits);
  return {vtstq_u32(all, vld1q_u32(kBitOfRay)), vtstq_u32(all, vld1q_u32(kBitOfRay + 4))};
}
// Lanes of a where the mask is set, of b elsewhere.
PERFECT_BVH_INLINE RayFloat select(const RayMask& mask, const RayFloat& a, const RayFloat& b) noexcept {
  return {vbslq_f32(mask.low, a.low, b.low), vbslq_f32(mask.high, a.high, b.high)};
}
PERFECT_BVH_INLINE uint32x4_t sign_lanes(float32x4_t a) noexcept {
  return vreinterpretq_u32_s32(vshrq_n_s32(vreinterpretq_s32_f32(a), 31));
}
// The sign bits.
PERFECT_BVH_INLINE unsigned signs(const RayFloat& a) noexcept {
  return bits(Mask8{sign_lanes(a.low), sign_lanes(a.high)});
}
PERFECT_BVH_INLINE RayFloat with_sign(const RayFloat& magnitude, const RayFloat& sign) noexcept {
  const uint32x4_t sign_bit = vdupq_n_u32(0x80000000u);
  return {vbslq_f32(sign_bit, sign.low, magnitude.low), vbslq_f32(sign_bit, sign.high, magnitude.high)};
}

// Half as many rays in double.
struct RayDouble {
  float64x2_t low, high;
};
PERFECT_BVH_INLINE RayDouble load_rays(const double* p) noexcept { return {vld1q_f64(p), vld1q_f64(p + 2)}; }
PERFECT_BVH_INLINE void store_rays(double* p, const RayDouble& a) noexcept {
  vst1q_f64(p, a.low), vst1q_f64(p + 2, a.high);
}
PERFECT_BVH_INLINE RayDouble every_ray(double x) noexcept { return {vdupq_n_f64(x), vdupq_n_f64(x)}; }
PERFECT_BVH_INLINE RayDouble add(const RayDouble& a, const RayDouble& b) noexcept {
  return {vaddq_f64(a.low, b.low), vaddq_f64(a.high, b.high)};
}
PERFECT_BVH_INLINE RayDouble sub(const RayDouble& a, const RayDouble& b) noexcept {
  return {vsubq_f64(a.low, b.low), vsubq_f64(a.high, b.high)};
}
PERFECT_BVH_INLINE RayDouble mul(const RayDouble& a, const RayDouble& b) noexcept {
  return {vmulq_f64(a.low, b.low), vmulq_f64(a.high, b.high)};
}
PERFECT_BVH_INLINE RayDouble div(const RayDouble& a, const RayDouble& b) noexcept {
  return {vdivq_f64(a.low, b.low), vdivq_f64(a.high, b.high)};
}
PERFECT_BVH_INLINE unsigned four_bits(uint64x2_t low, uint64x2_t high) noexcept {
  const uint32x4_t lanes = vuzp1q_u32(vreinterpretq_u32_u64(low), vreinterpretq_u32_u64(high));
  return vaddvq_u32(vandq_u32(lanes, vld1q_u32(kBitOfRay)));
}
// `limit` is not negative.
PERFECT_BVH_INLINE unsigned magnitudes_up_to(const RayDouble& a, const RayDouble& limit) noexcept {
  return four_bits(vcaleq_f64(a.low, limit.low), vcaleq_f64(a.high, limit.high));
}
PERFECT_BVH_INLINE unsigned magnitudes_from(const RayDouble& a, const RayDouble& limit) noexcept {
  return four_bits(vcageq_f64(a.low, limit.low), vcageq_f64(a.high, limit.high));
}
// The float nearest to each.
PERFECT_BVH_INLINE RayFloat load_narrowed(const double* p) noexcept {
  return {vcvt_high_f32_f64(vcvt_f32_f64(vld1q_f64(p)), vld1q_f64(p + 2)),
          vcvt_high_f32_f64(vcvt_f32_f64(vld1q_f64(p + 4)), vld1q_f64(p + 6))};
}

// Writes the lanes that `mask` names; the others are written as they were.
PERFECT_BVH_INLINE void store_some(float* p, const RayMask& mask, const RayFloat& a) noexcept {
  store_rays(p, select(mask, a, load_rays(p)));
}
PERFECT_BVH_INLINE void store_some(std::uint32_t* p, const RayMask& mask, std::uint32_t a) noexcept {
  const uint32x4_t all = vdupq_n_u32(a);
  vst1q_u32(p, vbslq_u32(mask.low, all, vld1q_u32(p)));
  vst1q_u32(p + 4, vbslq_u32(mask.high, all, vld1q_u32(p + 4)));
}
PERFECT_BVH_INLINE void store_some(double* p, uint32x4_t mask, float32x4_t a) noexcept {
  const int32x4_t lanes = vreinterpretq_s32_u32(mask);
  const uint64x2_t low = vreinterpretq_u64_s64(vmovl_s32(vget_low_s32(lanes)));
  const uint64x2_t high = vreinterpretq_u64_s64(vmovl_high_s32(lanes));
  vst1q_f64(p, vbslq_f64(low, vcvt_f64_f32(vget_low_f32(a)), vld1q_f64(p)));
  vst1q_f64(p + 2, vbslq_f64(high, vcvt_high_f64_f32(a), vld1q_f64(p + 2)));
}
PERFECT_BVH_INLINE void store_some(double* p, const RayMask& mask, const RayFloat& a) noexcept {
  store_some(p, mask.low, a.low), store_some(p + 4, mask.high, a.high);
}
PERFECT_BVH_INLINE float largest(const RayFloat& a) noexcept { return vmaxvq_f32(vmaxq_f32(a.low, a.high)); }

// How many triangles a leaf block has without the last one's repetitions. The number before the first is any.
PERFECT_BVH_INLINE unsigned count_distinct(const std::uint32_t* primitives) noexcept {
  const Int8 own = load(primitives), before = load(primitives - 1);
  const unsigned same = bits(Mask8{vceqq_u32(own.low, before.low), vceqq_u32(own.high, before.high)});
  return 8 - count_bits(same & 0xFEu);
}
PERFECT_BVH_INLINE uint32x4_t used_corners(uint32x4_t packed) noexcept {
  const uint32x4_t one = vdupq_n_u32(1), seven = vdupq_n_u32(7);
  const auto bit = [&](uint32x4_t vertex)
                       __attribute__((always_inline)) { return vshlq_u32(one, vreinterpretq_s32_u32(vertex)); };
  const uint32x4_t a = bit(vandq_u32(packed, seven)), b = bit(vandq_u32(vshrq_n_u32(packed, 4), seven));
  return vorrq_u32(vorrq_u32(a, b), bit(vandq_u32(vshrq_n_u32(packed, 8), seven)));
}
// Bit i: vertex i is a corner of some triangle. The highest such bit is right; lower ones may be missing, or set, too.
PERFECT_BVH_INLINE unsigned used_corners(const std::uint32_t* corners) noexcept {
  const Int8 packed = load(corners);
  return vmaxvq_u32(vorrq_u32(used_corners(packed.low), used_corners(packed.high)));
}

// As push_sorted, with `flags` + which place of the node each child has, to `places`.
PERFECT_BVH_INLINE unsigned push_boxes(const WideNode& node, std::uint32_t order_shift, const Mask8& hit,
                                       const Float8& near, std::uint32_t flags, std::uint32_t* children, float* nears,
                                       std::uint32_t* places) noexcept {
  const SortedChildren sorted = sort_children(node, order_shift, hit);
  store_permuted(children, load(node.child), sorted.bytes);
  store_permuted(nears, near, sorted.bytes);
  // The first bytes are four times the places.
  const uint32x4_t flagged = vdupq_n_u32(flags), place = vdupq_n_u32(7);
  vst1q_u32(places, vorrq_u32(flagged, vandq_u32(vshrq_n_u32(vreinterpretq_u32_u8(sorted.bytes.low), 2), place)));
  vst1q_u32(places + 4, vorrq_u32(flagged, vandq_u32(vshrq_n_u32(vreinterpretq_u32_u8(sorted.bytes.high), 2), place)));
  return count_bits(sorted.mask);
}

}  // namespace
}  // namespace perfect_bvh
