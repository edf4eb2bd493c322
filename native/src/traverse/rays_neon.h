// Computes the constants of a level from a ray in double, with NEON: x and y in one register, z in another. The
// operations are those of math/slab.h, math/triangle.h and ray.h, so the bits are the same.
// Included by translation units of kernels only; everything in it has internal linkage.
#pragma once

#include <arm_neon.h>

#include <cstddef>
#include <cstring>

#include "traverse/isa_neon.h"
#include "traverse/ray.h"

namespace perfect_bvh {
namespace {

// The fourth component is 0.
struct Double4Halves {
  float64x2_t xy, zw;
};

__attribute__((always_inline)) inline Double4Halves first_three(const double* p) noexcept {
  return {vld1q_f64(p), vcombine_f64(vld1_f64(p + 2), vdup_n_f64(0.0))};
}
__attribute__((always_inline)) inline Double4Halves load_four(const double* p) noexcept {
  return {vld1q_f64(p), vld1q_f64(p + 2)};
}
__attribute__((always_inline)) inline void store_four(double* p, float64x2_t xy, float64x2_t zw) noexcept {
  vst1q_f64(p, xy), vst1q_f64(p + 2, zw);
}
__attribute__((always_inline)) inline std::uint64_t lanes_of_mask(uint64x2_t mask) noexcept {
  return vget_lane_u64(vreinterpret_u64_u32(vmovn_u64(mask)), 0);
}
__attribute__((always_inline)) inline float32x4_t narrowed_four(const double* p) noexcept {
  return vcvt_high_f32_f64(vcvt_f32_f64(vld1q_f64(p)), vld1q_f64(p + 2));
}

__attribute__((always_inline)) inline bool load_ray(ObjectRay& out, const Ray& ray, double scale) noexcept {
  const Double4Halves origin = first_three(&ray.origin.x), direction = first_three(&ray.direction.x);
  store_four(out.origin, vmulq_n_f64(origin.xy, scale), vmulq_n_f64(origin.zw, scale));
  store_four(out.direction, vmulq_n_f64(direction.xy, scale), vmulq_n_f64(direction.zw, scale));
  out.time = {0.0, 1.0, true};
  const uint64x2_t xy = vceqzq_f64(vsubq_f64(origin.xy, origin.xy));
  return lanes_of_mask(vandq_u64(xy, vceqzq_f64(vsubq_f64(origin.zw, origin.zw)))) == ~std::uint64_t{0};
}

__attribute__((always_inline)) inline bool load_near(ObjectRay& out, const Ray& ray, double scale,
                                                     double farthest) noexcept {
  return load_near_by_axis(out, ray, scale, farthest);
}

// Loads four rays as columns: x, y and z of their origins, then of their directions, times `scale`. The first column is
// at `columns`, each next one `stride` doubles further. No origin component is minus zero. Also loads the ends of their
// ranges.
__attribute__((always_inline)) inline void load_columns(const Ray* const* rays, double scale, double* columns,
                                                        std::size_t stride, float* t_min, float* t_max) noexcept {
  for (std::size_t i = 0; i < 4; ++i) {
    const double *const origin = &rays[i]->origin.x, *const direction = &rays[i]->direction.x;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      columns[axis * stride + i] = origin[axis] * scale + 0.0;
      columns[(axis + 3) * stride + i] = direction[axis] * scale;
    }
    t_min[i] = rays[i]->t_min, t_max[i] = rays[i]->t_max;
  }
}

__attribute__((always_inline)) inline void map_to_local(ObjectRay& out, const ObjectRay& ray,
                                                        const MapColumns& map) noexcept {
  const Double4Halves x = load_four(map[0]), y = load_four(map[1]), z = load_four(map[2]), moved = load_four(map[3]);
  const auto linear = [](float64x2_t a, float64x2_t b, float64x2_t c, const double* v) __attribute__((always_inline)) {
    return vaddq_f64(vaddq_f64(vmulq_n_f64(a, v[0]), vmulq_n_f64(b, v[1])), vmulq_n_f64(c, v[2]));
  };
  store_four(out.origin, vaddq_f64(linear(x.xy, y.xy, z.xy, ray.origin), moved.xy),
             vaddq_f64(linear(x.zw, y.zw, z.zw, ray.origin), moved.zw));
  store_four(out.direction, linear(x.xy, y.xy, z.xy, ray.direction), linear(x.zw, y.zw, z.zw, ray.direction));
  out.time = ray.time;
}

__attribute__((always_inline)) inline bool stands_near(const ObjectRay& ray, double reach) noexcept {
  const Double4Halves direction = load_four(ray.direction), origin = load_four(ray.origin);
  const float64x2_t longest = vdupq_n_f64(kLongest), shortest = vdupq_n_f64(kShortest);
  const float64x2_t farthest = vdupq_n_f64(kNearby * reach);
  const uint64x2_t all = vandq_u64(vandq_u64(vcaleq_f64(direction.xy, longest), vcaleq_f64(direction.zw, longest)),
                                   vandq_u64(vcaleq_f64(origin.xy, farthest), vcaleq_f64(origin.zw, farthest)));
  const uint64x2_t any = vorrq_u64(vcageq_f64(direction.xy, shortest), vcageq_f64(direction.zw, shortest));
  return lanes_of_mask(all) == ~std::uint64_t{0} && lanes_of_mask(any) != 0;
}

// For the longest axis k: the axes k + 1, k + 2, k, k and four times k, as bytes of floats, and values that depend on
// them.
struct alignas(64) ShearFrame {
  std::uint8_t order[16], longest[16];
  std::uint8_t axes[4];
  std::uint16_t row[4];
};
static constexpr ShearFrame shear_frame(unsigned k) noexcept {
  const unsigned axes[4] = {(k + 1) % 3, (k + 2) % 3, k, k};
  ShearFrame frame{};
  for (unsigned byte = 0; byte < 16; ++byte) {
    frame.order[byte] = static_cast<std::uint8_t>(4 * axes[byte / 4] + byte % 4);
    frame.longest[byte] = static_cast<std::uint8_t>(4 * k + byte % 4);
  }
  for (unsigned i = 0; i < 3; ++i) {
    frame.axes[i] = static_cast<std::uint8_t>(axes[i]);
    frame.row[i] = static_cast<std::uint16_t>(32 * axes[i]);
  }
  return frame;
}
constexpr ShearFrame kFrames[3] = {shear_frame(0), shear_frame(1), shear_frame(2)};
alignas(16) constexpr std::uint32_t kBitOfAxis[4] = {1, 2, 4, 0};
alignas(16) constexpr float kShares[4] = {kSmallestShare, kReachShare, kPlaneSlack, kDepthSlack};

__attribute__((always_inline)) inline float32x4_t lanes_at(float32x4_t a, uint8x16_t bytes) noexcept {
  return vreinterpretq_f32_u8(vqtbl1q_u8(vreinterpretq_u8_f32(a), bytes));
}

__attribute__((always_inline)) inline const ShearFrame& frame_of(float32x4_t length) noexcept {
  const float x = vgetq_lane_f32(length, 0), y = vgetq_lane_f32(length, 1), z = vgetq_lane_f32(length, 2);
  const unsigned longer = x > y ? 0 : 1;  // as longest_axis()
  return kFrames[larger(x, y) > z ? longer : 2];
}

__attribute__((always_inline)) inline void set_states(BoxState& box, TriangleState& triangle, const ObjectRay& ray,
                                                      const TreeExtent& extent) noexcept {
  const uint32x4_t sign_bit = vdupq_n_u32(0x80000000u);
  const float32x4_t origin = narrowed_four(ray.origin), direction = narrowed_four(ray.direction);
  const float32x4_t length = vabsq_f32(direction);
  const ShearFrame& frame = frame_of(length);
  const uint8x16_t order = vld1q_u8(frame.order), longest = vld1q_u8(frame.longest);

  // As in set_slab_ray().
  const float32x4_t shares = vld1q_f32(kShares);
  const float32x4_t smallest = vmulq_laneq_f32(lanes_at(length, longest), shares, 0);
  const float32x4_t raised = vbslq_f32(sign_bit, direction, vmaxq_f32(length, smallest));
  const float32x4_t inverse = vdivq_f32(vdupq_n_f32(1.0f), raised);
  const float32x4_t inverse_length = vabsq_f32(inverse);
  const float32x4_t reach = vaddq_f32(vld1q_f32(extent.largest), vabsq_f32(origin));
  const float32x4_t long_reach = lanes_at(reach, longest);
  const float32x4_t long_depth = vmulq_f32(long_reach, lanes_at(inverse_length, longest));
  const float32x4_t raised_reach = vaddq_f32(reach, vmulq_laneq_f32(long_reach, shares, 1));
  const float32x4_t slack = vaddq_f32(vmulq_laneq_f32(vmulq_f32(raised_reach, inverse_length), shares, 2),
                                      vmulq_laneq_f32(long_depth, shares, 3));
  const float32x4_t at_origin = vmulq_f32(origin, inverse);
  // Each store's fourth lane is overwritten by the next one.
  vst1q_f32(box.slab.inverse, inverse);
  vst1q_f32(box.slab.near_offset, vaddq_f32(at_origin, slack));
  vst1q_f32(box.slab.far_offset, vsubq_f32(at_origin, slack));
  const uint32x4_t runs_down = vtstq_u32(vreinterpretq_u32_f32(inverse), sign_bit);
  box.rows = kOctantRows[vaddvq_u32(vandq_u32(runs_down, vld1q_u32(kBitOfAxis)))];

  // As in set_triangle_ray().
  const float32x4_t along = lanes_at(direction, order);
  vst1q_f32(triangle.ray.origin, lanes_at(origin, order));
  vst1_f32(&triangle.ray.shear_x, vget_low_f32(vmulq_f32(along, lanes_at(inverse, longest))));
  const float direction_z = vgetq_lane_f32(along, 2);
  triangle.ray.direction_z = direction_z;
  triangle.ray.depth_slack = kDepthReach * vgetq_lane_f32(long_depth, 0);
  triangle.ray.edge_slack = kEdgeReach * vmaxvq_f32(reach);  // the fourth lane never exceeds the others' maximum
  std::memcpy(triangle.ray.axes, frame.axes, sizeof(triangle.ray.axes));
  triangle.ray.runs_down = direction_z < 0.0f;
  std::memcpy(triangle.row, frame.row, sizeof(frame.row));
}

// Simd rays neon ------------------------------------------------------------------------------------------------------
// Eight rays in two registers with NEON, with the arithmetic of isa_neon.h.
// Included by one translation unit only, after isa_neon.h; everything in it has internal linkage.

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
// Returns the lanes of a where the mask is set, of b elsewhere.
PERFECT_BVH_INLINE RayFloat select(const RayMask& mask, const RayFloat& a, const RayFloat& b) noexcept {
  return {vbslq_f32(mask.low, a.low, b.low), vbslq_f32(mask.high, a.high, b.high)};
}
PERFECT_BVH_INLINE uint32x4_t sign_lanes(float32x4_t a) noexcept {
  return vreinterpretq_u32_s32(vshrq_n_s32(vreinterpretq_s32_f32(a), 31));
}
// Returns the sign bits.
PERFECT_BVH_INLINE unsigned signs(const RayFloat& a) noexcept {
  return bits(Mask8{sign_lanes(a.low), sign_lanes(a.high)});
}
PERFECT_BVH_INLINE RayFloat with_sign(const RayFloat& magnitude, const RayFloat& sign) noexcept {
  const uint32x4_t sign_bit = vdupq_n_u32(0x80000000u);
  return {vbslq_f32(sign_bit, sign.low, magnitude.low), vbslq_f32(sign_bit, sign.high, magnitude.high)};
}

// Two registers of doubles, for half as many rays.
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
// Rounds each to the nearest float.
PERFECT_BVH_INLINE RayFloat load_narrowed(const double* p) noexcept {
  return {vcvt_high_f32_f64(vcvt_f32_f64(vld1q_f64(p)), vld1q_f64(p + 2)),
          vcvt_high_f32_f64(vcvt_f32_f64(vld1q_f64(p + 4)), vld1q_f64(p + 6))};
}

// Writes the lanes set in `mask`; the others are rewritten unchanged.
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

// Like push_sorted; also writes `flags` + each child's slot in the node to `places`.
PERFECT_BVH_INLINE unsigned push_boxes(const WideNode& node, std::uint32_t order_shift, const Mask8& hit,
                                       const Float8& near, std::uint32_t flags, std::uint32_t* children, float* nears,
                                       std::uint32_t* places) noexcept {
  const SortedChildren sorted = sort_children(node, order_shift, hit);
  store_permuted(children, load(node.child), sorted.bytes);
  store_permuted(nears, near, sorted.bytes);
  // The first bytes are four times the slots.
  const uint32x4_t flagged = vdupq_n_u32(flags), place = vdupq_n_u32(7);
  vst1q_u32(places, vorrq_u32(flagged, vandq_u32(vshrq_n_u32(vreinterpretq_u32_u8(sorted.bytes.low), 2), place)));
  vst1q_u32(places + 4, vorrq_u32(flagged, vandq_u32(vshrq_n_u32(vreinterpretq_u32_u8(sorted.bytes.high), 2), place)));
  return count_bits(sorted.mask);
}

}  // namespace

}  // namespace perfect_bvh
