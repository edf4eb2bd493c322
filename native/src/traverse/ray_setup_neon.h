// From a ray in double to the constants of its level, with NEON: x and y in one register, z in another. The same
// operations as in math/slab.h, math/triangle.h and object_ray.h, so the same bits.
// Included by translation units of kernels only; everything in it has internal linkage.
#pragma once

#include <arm_neon.h>

#include <cstddef>
#include <cstring>

#include "traverse/ray_state.h"

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

// Four rays side by side: their origins' x, y and z, then their directions', times `scale`, at `columns` and so many
// doubles further each, no origin minus zero; and the ends of their ranges.
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

// By the longest axis k: the axes k + 1, k + 2, k, k and four times k, as bytes of floats, and what depends on them.
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
  triangle.ray.edge_slack = kEdgeReach * vmaxvq_f32(reach);  // the fourth lane, the largest extent, is not more
  std::memcpy(triangle.ray.axes, frame.axes, sizeof(triangle.ray.axes));
  triangle.ray.runs_down = direction_z < 0.0f;
  std::memcpy(triangle.row, frame.row, sizeof(frame.row));
}

}  // namespace
}  // namespace perfect_bvh
