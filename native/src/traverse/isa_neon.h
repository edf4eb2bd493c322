// Eight lanes with NEON, which every 64-bit ARM has: two registers of four. Masks are vectors. Permutations are byte
// lookups, with indices from tables in memory.
// Included by one translation unit only; everything in it has internal linkage.
#pragma once

#include <arm_neon.h>

#include "traverse/scene_view.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

struct Float8 {
  float32x4_t low, high;
};
struct Int8 {
  uint32x4_t low, high;
};
struct Mask8 {
  uint32x4_t low, high;
};

#define PERFECT_BVH_INLINE inline __attribute__((always_inline))

PERFECT_BVH_INLINE Float8 load(const float* p) noexcept { return {vld1q_f32(p), vld1q_f32(p + 4)}; }
PERFECT_BVH_INLINE Int8 load(const std::uint32_t* p) noexcept { return {vld1q_u32(p), vld1q_u32(p + 4)}; }
PERFECT_BVH_INLINE Float8 load_row(const void* base, std::size_t byte_offset) noexcept {
  return load(reinterpret_cast<const float*>(static_cast<const char*>(base) + byte_offset));
}
PERFECT_BVH_INLINE void store(float* p, const Float8& a) noexcept { vst1q_f32(p, a.low), vst1q_f32(p + 4, a.high); }
PERFECT_BVH_INLINE Float8 broadcast(const float& x) noexcept { return {vdupq_n_f32(x), vdupq_n_f32(x)}; }
PERFECT_BVH_INLINE Float8 zero() noexcept { return broadcast(0.0f); }
PERFECT_BVH_INLINE Float8 add(const Float8& a, const Float8& b) noexcept {
  return {vaddq_f32(a.low, b.low), vaddq_f32(a.high, b.high)};
}
PERFECT_BVH_INLINE Float8 sub(const Float8& a, const Float8& b) noexcept {
  return {vsubq_f32(a.low, b.low), vsubq_f32(a.high, b.high)};
}
PERFECT_BVH_INLINE Float8 mul(const Float8& a, const Float8& b) noexcept {
  return {vmulq_f32(a.low, b.low), vmulq_f32(a.high, b.high)};
}
PERFECT_BVH_INLINE Float8 div(const Float8& a, const Float8& b) noexcept {
  return {vdivq_f32(a.low, b.low), vdivq_f32(a.high, b.high)};
}
PERFECT_BVH_INLINE Float8 fmadd(const Float8& a, const Float8& b, const Float8& c) noexcept {
  return {vfmaq_f32(c.low, a.low, b.low), vfmaq_f32(c.high, a.high, b.high)};
}
// Not computed as -(c - a b), whose zeros have the other sign.
PERFECT_BVH_INLINE Float8 fmsub(const Float8& a, const Float8& b, const Float8& c) noexcept {
  return {vfmaq_f32(vnegq_f32(c.low), a.low, b.low), vfmaq_f32(vnegq_f32(c.high), a.high, b.high)};
}
PERFECT_BVH_INLINE Float8 fnmadd(const Float8& a, const Float8& b, const Float8& c) noexcept {
  return {vfmsq_f32(c.low, a.low, b.low), vfmsq_f32(c.high, a.high, b.high)};
}
// Returns NaN if either value is NaN, and of two zeros the lesser (the greater). This differs from x86, but later
// comparisons do not depend on it. The sign of a zero decides nothing. No active ray has a NaN in its constants or its
// range (ray.h), and the weights of a triangle that has a NaN are rejected either way.
PERFECT_BVH_INLINE Float8 min(const Float8& a, const Float8& b) noexcept {
  return {vminq_f32(a.low, b.low), vminq_f32(a.high, b.high)};
}
PERFECT_BVH_INLINE Float8 max(const Float8& a, const Float8& b) noexcept {
  return {vmaxq_f32(a.low, b.low), vmaxq_f32(a.high, b.high)};
}
PERFECT_BVH_INLINE Float8 abs(const Float8& a) noexcept { return {vabsq_f32(a.low), vabsq_f32(a.high)}; }

// Returns t where a ray hits eight planes across an axis. `inverse` and `offset` are those of a SlabRay: a fourth float
// after the three may be read.
template <int kAxis>
PERFECT_BVH_INLINE Float8 plane_depths(const Float8& planes, const float* inverse, const float* offset) noexcept {
  const float32x4_t factors = vld1q_f32(inverse), negated = vnegq_f32(vld1q_f32(offset));
  const float32x4_t start = vdupq_laneq_f32(negated, kAxis);
  return {vfmaq_laneq_f32(start, planes.low, factors, kAxis), vfmaq_laneq_f32(start, planes.high, factors, kAxis)};
}

PERFECT_BVH_INLINE Mask8 less_equal(const Float8& a, const Float8& b) noexcept {
  return {vcleq_f32(a.low, b.low), vcleq_f32(a.high, b.high)};
}
PERFECT_BVH_INLINE Mask8 less(const Float8& a, const Float8& b) noexcept {
  return {vcltq_f32(a.low, b.low), vcltq_f32(a.high, b.high)};
}
PERFECT_BVH_INLINE Mask8 both(const Mask8& a, const Mask8& b) noexcept {
  return {vandq_u32(a.low, b.low), vandq_u32(a.high, b.high)};
}
PERFECT_BVH_INLINE Mask8 either(const Mask8& a, const Mask8& b) noexcept {
  return {vorrq_u32(a.low, b.low), vorrq_u32(a.high, b.high)};
}
// Unlike on x86, also true if either is NaN: see min.
PERFECT_BVH_INLINE Mask8 not_equal(const Float8& a, const Float8& b) noexcept {
  return {vmvnq_u32(vceqq_f32(a.low, b.low)), vmvnq_u32(vceqq_f32(a.high, b.high))};
}

// Returns the lowest 16 bits of each lane.
PERFECT_BVH_INLINE uint16x8_t narrowed(uint32x4_t low, uint32x4_t high) noexcept {
  return vuzp1q_u16(vreinterpretq_u16_u32(low), vreinterpretq_u16_u32(high));
}

alignas(16) constexpr std::uint16_t kBitOfLane[8] = {1, 2, 4, 8, 16, 32, 64, 128};
alignas(8) constexpr std::uint8_t kBitOfByte[8] = {1, 2, 4, 8, 16, 32, 64, 128};

PERFECT_BVH_INLINE unsigned bits(const Mask8& mask) noexcept {
  return vaddvq_u16(vandq_u16(narrowed(mask.low, mask.high), vld1q_u16(kBitOfLane)));
}

// Row m: the lanes set in m, in order, four bytes each; the rest is lane 0. Byte k of lane i is kStride i + kByte k.
template <unsigned kStride, unsigned kByte>
struct alignas(32) CompressTable {
  std::uint8_t rows[256][32];
  constexpr CompressTable() noexcept : rows{} {
    for (unsigned mask = 0; mask < 256; ++mask) {
      unsigned place = 0;
      for (unsigned lane = 0; lane < 8; ++lane) {
        if ((mask & (1u << lane)) == 0) continue;
        for (unsigned k = 0; k < 4; ++k) {
          rows[mask][4 * place + k] = static_cast<std::uint8_t>(kStride * lane + kByte * k);
        }
        ++place;
      }
    }
  }
};
constexpr CompressTable<1, 0> kCompressLanes;
constexpr CompressTable<4, 1> kCompressBytes;

// The number of bits of a mask of eight, from a table: NEON counts bits in vector registers, and moving to and from
// them takes longer.
struct BitCounts {
  std::uint8_t of[256];
  constexpr BitCounts() noexcept : of{} {
    for (unsigned mask = 1; mask < 256; ++mask) of[mask] = static_cast<std::uint8_t>(of[mask / 2] + mask % 2);
  }
};
constexpr BitCounts kBitCounts;
PERFECT_BVH_INLINE unsigned count_bits(unsigned mask) noexcept { return kBitCounts.of[mask]; }
// Returns the lanes of a leaf block that repeat the previous triangle. The number before the first may be anything.
PERFECT_BVH_INLINE unsigned repeated_lanes(const std::uint32_t* primitives) noexcept {
  const Int8 own = load(primitives), before = load(primitives - 1);
  return bits(Mask8{vceqq_u32(own.low, before.low), vceqq_u32(own.high, before.high)}) & 0xFEu;
}

template <int kCount>
PERFECT_BVH_INLINE Int8 shift_right(const Int8& a) noexcept {
  return {vshrq_n_u32(a.low, kCount), vshrq_n_u32(a.high, kCount)};
}

// Returns bits 10 kPlace to 10 kPlace + 9 of each word, as floats.
template <int kPlace>
PERFECT_BVH_INLINE Float8 ten_bits(const Int8& words) noexcept {
  Int8 shifted = words;
  if constexpr (kPlace > 0) shifted = shift_right<10 * kPlace>(words);
  const uint32x4_t ten = vdupq_n_u32(0x3FF);
  return {vcvtq_f32_u32(vandq_u32(shifted.low, ten)), vcvtq_f32_u32(vandq_u32(shifted.high, ten))};
}
PERFECT_BVH_INLINE Float8 load_small(const std::uint8_t* p) noexcept {
  const uint16x8_t wide = vmovl_u8(vld1_u8(p));
  return {vcvtq_f32_u32(vmovl_u16(vget_low_u16(wide))), vcvtq_f32_u32(vmovl_u16(vget_high_u16(wide)))};
}

// The indices of the bytes of two registers that are moved to two others.
struct Bytes {
  uint8x16_t low, high;
};
PERFECT_BVH_INLINE Bytes load_bytes(const std::uint8_t* p) noexcept { return {vld1q_u8(p), vld1q_u8(p + 16)}; }
PERFECT_BVH_INLINE uint8x16_t bytes_of_lanes(uint32x4_t index) noexcept {
  const uint32x4_t lane = vandq_u32(index, vdupq_n_u32(7));
  return vreinterpretq_u8_u32(vmlaq_u32(vdupq_n_u32(0x03020100), lane, vdupq_n_u32(0x04040404)));
}
PERFECT_BVH_INLINE uint8x16x2_t table_of(const Float8& a) noexcept {
  return {{vreinterpretq_u8_f32(a.low), vreinterpretq_u8_f32(a.high)}};
}
PERFECT_BVH_INLINE uint8x16x2_t table_of(const Int8& a) noexcept {
  return {{vreinterpretq_u8_u32(a.low), vreinterpretq_u8_u32(a.high)}};
}
PERFECT_BVH_INLINE uint8x16x2_t table_of(const Mask8& a) noexcept {
  return {{vreinterpretq_u8_u32(a.low), vreinterpretq_u8_u32(a.high)}};
}
// Lane i becomes a[index[i] & 7].
PERFECT_BVH_INLINE Float8 permute(const Float8& a, const Int8& index) noexcept {
  const uint8x16x2_t table = table_of(a);
  return {vreinterpretq_f32_u8(vqtbl2q_u8(table, bytes_of_lanes(index.low))),
          vreinterpretq_f32_u8(vqtbl2q_u8(table, bytes_of_lanes(index.high)))};
}
PERFECT_BVH_INLINE void store_permuted(std::uint32_t* to, const Int8& a, const Bytes& from) noexcept {
  const uint8x16x2_t table = table_of(a);
  vst1q_u32(to, vreinterpretq_u32_u8(vqtbl2q_u8(table, from.low)));
  vst1q_u32(to + 4, vreinterpretq_u32_u8(vqtbl2q_u8(table, from.high)));
}
PERFECT_BVH_INLINE void store_permuted(float* to, const Float8& a, const Bytes& from) noexcept {
  const uint8x16x2_t table = table_of(a);
  vst1q_f32(to, vreinterpretq_f32_u8(vqtbl2q_u8(table, from.low)));
  vst1q_f32(to + 4, vreinterpretq_f32_u8(vqtbl2q_u8(table, from.high)));
}

// The hit children of a node, the farthest first: the positions of their bytes, and a mask of the slots in use.
struct SortedChildren {
  Bytes bytes;
  unsigned mask;
};
PERFECT_BVH_INLINE SortedChildren sort_children(const WideNode& node, std::uint32_t order_shift,
                                                const Mask8& hit) noexcept {
  const Int8 orders = load(node.order);
  // Four times the slots: the positions of the children's first bytes.
  const int32x4_t shift = vdupq_n_s32(2 - static_cast<std::int32_t>(order_shift));
  const uint8x16_t pairs = vreinterpretq_u8_u16(narrowed(vshlq_u32(orders.low, shift), vshlq_u32(orders.high, shift)));
  const uint8x16_t order = vandq_u8(vuzp1q_u8(pairs, pairs), vdupq_n_u8(4 * 7));
  const uint8x8_t hit_places = vqtbl2_u8(table_of(hit), vget_low_u8(order));
  const unsigned mask = vaddv_u8(vand_u8(hit_places, vld1_u8(kBitOfByte)));
  const Bytes lanes = load_bytes(kCompressLanes.rows[mask]);
  const uint8x16_t part = vreinterpretq_u8_u32(vdupq_n_u32(0x03020100));
  return {{vorrq_u8(vqtbl1q_u8(order, lanes.low), part), vorrq_u8(vqtbl1q_u8(order, lanes.high), part)}, mask};
}

// Writes the children in `hit` to `children` (all 8 entries may be overwritten), the farthest first, and their entry
// distances to `nears`. Returns their number.
PERFECT_BVH_INLINE unsigned push_sorted(const WideNode& node, std::uint32_t order_shift, const Mask8& hit,
                                        const Float8& near, std::uint32_t* children, float* nears) noexcept {
  const SortedChildren sorted = sort_children(node, order_shift, hit);
  store_permuted(children, load(node.child), sorted.bytes);
  store_permuted(nears, near, sorted.bytes);
  return count_bits(sorted.mask);
}
PERFECT_BVH_INLINE unsigned push_unsorted(const WideNode& node, const Mask8& hit, std::uint32_t* children) noexcept {
  const unsigned mask = bits(hit);
  store_permuted(children, load(node.child), load_bytes(kCompressBytes.rows[mask]));
  return count_bits(mask);
}
// Moves the first `count` (at most 8) entries whose `nears` do not exceed `limit` to the front of `to_*`. That may be
// the same array or begin before it; all 8 entries there may be overwritten. Returns the number of entries kept.
PERFECT_BVH_INLINE unsigned keep_near(const std::uint32_t* children, const float* nears, unsigned count,
                                      const Float8& limit, std::uint32_t* to_children, float* to_nears) noexcept {
  const Float8 near = load(nears);
  const Int8 child = load(children);
  const unsigned kept = bits(less_equal(near, limit)) & ~(~0u << count);
  const Bytes bytes = load_bytes(kCompressBytes.rows[kept]);
  store_permuted(to_nears, near, bytes);
  store_permuted(to_children, child, bytes);
  return count_bits(kept);
}

// Gather neon ---------------------------------------------------------------------------------------------------------
// Reads spheres with NEON: one load of four floats each; four of them are transposed into four rows. Included by one
// translation unit only; everything in it has internal linkage.

// `ball(lane)` returns the sphere of that lane.
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
