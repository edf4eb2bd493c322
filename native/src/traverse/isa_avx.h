// Eight lanes in one 256-bit register: the code shared by AVX2 and AVX-512VL, which differ in masks and compression.
// Included by one translation unit only; everything in it has internal linkage.
#pragma once

#include <immintrin.h>

#include <cstddef>
#include <cstring>

#include "traverse/ray.h"
#include "traverse/scene_view.h"
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
// Of two equal or unordered values, the second is returned, as everywhere on x86.
PERFECT_BVH_INLINE Float8 min(Float8 a, Float8 b) noexcept { return _mm256_min_ps(a, b); }
PERFECT_BVH_INLINE Float8 max(Float8 a, Float8 b) noexcept { return _mm256_max_ps(a, b); }
PERFECT_BVH_INLINE Float8 abs(Float8 a) noexcept { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), a); }

// Returns t where a ray hits eight planes across an axis. `inverse` and `offset` are those of a SlabRay: a fourth float
// after the three may be read.
template <int kAxis>
PERFECT_BVH_INLINE Float8 plane_depths(Float8 planes, const float* inverse, const float* offset) noexcept {
  return fmsub(planes, broadcast(inverse[kAxis]), broadcast(offset[kAxis]));
}

PERFECT_BVH_INLINE unsigned count_bits(unsigned mask) noexcept { return static_cast<unsigned>(_mm_popcnt_u32(mask)); }

template <int kCount>
PERFECT_BVH_INLINE Int8 shift_right(Int8 a) noexcept {
  return _mm256_srli_epi32(a, kCount);
}
// Returns bits 10 kPlace to 10 kPlace + 9 of each word, as floats.
template <int kPlace>
PERFECT_BVH_INLINE Float8 ten_bits(Int8 words) noexcept {
  return _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(words, 10 * kPlace), _mm256_set1_epi32(0x3FF)));
}
PERFECT_BVH_INLINE Float8 load_small(const std::uint8_t* p) noexcept {
  return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p))));
}
// Lane i becomes a[index[i] & 7].
PERFECT_BVH_INLINE Float8 permute(Float8 a, Int8 index) noexcept { return _mm256_permutevar8x32_ps(a, index); }

// Returns the lanes of a leaf block that repeat the previous triangle. The number before the first may be anything.
PERFECT_BVH_INLINE unsigned repeated_lanes(const std::uint32_t* primitives) noexcept {
  const Int8 before = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(primitives - 1));
  const Int8 same = _mm256_cmpeq_epi32(load(primitives), before);
  return static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(same))) & 0xFEu;
}

// Plane avx -----------------------------------------------------------------------------------------------------------
// Computes t of one triangle's plane with AVX: plane_t() of plane_of(), three axes at a time. The operations are the
// same, so the bits are too. Included by each of the translation units that have AVX2; everything in it has internal
// linkage.

// `at(corner, axis)` returns a coordinate of a corner. origin, direction: four doubles, aligned, the last 0.
template <class Corners>
inline __attribute__((always_inline)) double meet_plane(const Corners& at, const double* origin,
                                                        const double* direction) noexcept {
  const auto corner = [&](int i) __attribute__((always_inline)) {
    return _mm256_cvtps_pd(_mm_setr_ps(at(i, 0), at(i, 1), at(i, 2), 0.0f));
  };
  const auto next = [](__m256d v) __attribute__((always_inline)) {  // y, z, x
    return _mm256_permute4x64_pd(v, _MM_SHUFFLE(3, 0, 2, 1));
  };
  const __m256d point = corner(0), to_b = _mm256_sub_pd(corner(1), point), to_c = _mm256_sub_pd(corner(2), point);
  // z, x, y of the normal
  const __m256d turned = _mm256_sub_pd(_mm256_mul_pd(to_b, next(to_c)), _mm256_mul_pd(next(to_b), to_c));
  const __m256d normal = next(turned);
  const __m256d away = _mm256_mul_pd(normal, _mm256_sub_pd(point, _mm256_load_pd(origin)));
  const __m256d along = _mm256_mul_pd(normal, _mm256_load_pd(direction));
  const __m256d pairs = _mm256_hadd_pd(away, along);  // x + y of both, then z + 0 of both
  const __m128d sums = _mm_add_pd(_mm256_castpd256_pd128(pairs), _mm256_extractf128_pd(pairs, 1));
  return _mm_cvtsd_f64(_mm_div_sd(sums, _mm_unpackhi_pd(sums, sums)));
}

// Ray setup avx -------------------------------------------------------------------------------------------------------
// Computes the constants of a level from a ray in double, three axes at a time. The operations are those of
// math/slab.h, math/triangle.h and ray.h, so the bits are the same.
// Included by translation units of kernels only; everything in it has internal linkage.

static_assert(offsetof(Ray, direction) == 24 && sizeof(Ray) >= 56);  // loads of four may read past the direction

__attribute__((always_inline)) inline __m256d first_three(const double* p) noexcept {
  return _mm256_blend_pd(_mm256_loadu_pd(p), _mm256_setzero_pd(), 8);
}
__attribute__((always_inline)) inline unsigned axes_of(__m256d mask) noexcept {
  return static_cast<unsigned>(_mm256_movemask_pd(mask)) & 7u;
}
__attribute__((always_inline)) inline __m256d magnitudes(__m256d a) noexcept {
  return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a);
}

__attribute__((always_inline)) inline bool load_ray(ObjectRay& out, const Ray& ray, double scale) noexcept {
  const __m256d origin = first_three(&ray.origin.x), direction = first_three(&ray.direction.x);
  const __m256d factor = _mm256_set1_pd(scale);
  _mm256_store_pd(out.origin, _mm256_mul_pd(origin, factor));
  _mm256_store_pd(out.direction, _mm256_mul_pd(direction, factor));
  out.time = {0.0, 1.0, true};
  return axes_of(_mm256_cmp_pd(_mm256_sub_pd(origin, origin), _mm256_setzero_pd(), _CMP_EQ_OQ)) == 7;
}

__attribute__((always_inline)) inline bool load_near(ObjectRay& out, const Ray& ray, double scale,
                                                     double farthest) noexcept {
  const __m256d factor = _mm256_set1_pd(scale);
  const __m256d origin = _mm256_mul_pd(first_three(&ray.origin.x), factor);
  const __m256d direction = _mm256_mul_pd(first_three(&ray.direction.x), factor);
  const __m256d length = magnitudes(direction);
  const __m256d usual = _mm256_and_pd(_mm256_cmp_pd(length, _mm256_set1_pd(kShortest), _CMP_GE_OQ),
                                      _mm256_cmp_pd(length, _mm256_set1_pd(kLongest), _CMP_LE_OQ));
  const __m256d near = _mm256_cmp_pd(magnitudes(origin), _mm256_set1_pd(farthest), _CMP_LE_OQ);
  if (axes_of(_mm256_and_pd(usual, near)) != 7) return false;
  _mm256_store_pd(out.origin, _mm256_add_pd(origin, _mm256_setzero_pd()));
  _mm256_store_pd(out.direction, direction);
  out.time = {0.0, 1.0, true};
  return true;
}

// Loads four rays as columns: x, y and z of their origins, then of their directions, times `scale`. The first column is
// at `columns`, each next one `stride` doubles further. No origin component is minus zero. Also loads the ends of their
// ranges, which are moved as doubles of arbitrary bits.
__attribute__((always_inline)) inline void load_columns(const Ray* const* rays, double scale, double* columns,
                                                        std::size_t stride, float* t_min, float* t_max) noexcept {
  static_assert(offsetof(Ray, t_min) == 48 && offsetof(Ray, t_max) == 52 && sizeof(Ray) == 64);
  const __m256d factor = _mm256_set1_pd(scale);
  __m256d column[8];
  for (int half = 0; half < 2; ++half) {
    const auto row = [&](int i) __attribute__((always_inline)) {
      return _mm256_load_pd(reinterpret_cast<const double*>(rays[i]) + 4 * half);
    };
    const __m256d even01 = _mm256_unpacklo_pd(row(0), row(1)), odd01 = _mm256_unpackhi_pd(row(0), row(1));
    const __m256d even23 = _mm256_unpacklo_pd(row(2), row(3)), odd23 = _mm256_unpackhi_pd(row(2), row(3));
    column[4 * half] = _mm256_permute2f128_pd(even01, even23, 0x20);
    column[4 * half + 1] = _mm256_permute2f128_pd(odd01, odd23, 0x20);
    column[4 * half + 2] = _mm256_permute2f128_pd(even01, even23, 0x31);
    column[4 * half + 3] = _mm256_permute2f128_pd(odd01, odd23, 0x31);
  }
  for (std::size_t i = 0; i < 6; ++i) {
    const __m256d scaled = _mm256_mul_pd(column[i], factor);
    _mm256_store_pd(columns + i * stride, i < 3 ? _mm256_add_pd(scaled, _mm256_setzero_pd()) : scaled);
  }
  const __m128 first = _mm_castpd_ps(_mm256_castpd256_pd128(column[6]));
  const __m128 second = _mm_castpd_ps(_mm256_extractf128_pd(column[6], 1));
  _mm_store_ps(t_min, _mm_shuffle_ps(first, second, 0x88)), _mm_store_ps(t_max, _mm_shuffle_ps(first, second, 0xDD));
}

__attribute__((always_inline)) inline void map_to_local(ObjectRay& out, const ObjectRay& ray,
                                                        const MapColumns& map) noexcept {
  const __m256d x = _mm256_load_pd(map[0]), y = _mm256_load_pd(map[1]), z = _mm256_load_pd(map[2]);
  const auto linear = [&](const double* v) __attribute__((always_inline)) {
    const __m256d xy =
        _mm256_add_pd(_mm256_mul_pd(x, _mm256_broadcast_sd(v)), _mm256_mul_pd(y, _mm256_broadcast_sd(v + 1)));
    return _mm256_add_pd(xy, _mm256_mul_pd(z, _mm256_broadcast_sd(v + 2)));
  };
  _mm256_store_pd(out.origin, _mm256_add_pd(linear(ray.origin), _mm256_load_pd(map[3])));
  _mm256_store_pd(out.direction, linear(ray.direction));
  out.time = ray.time;
}

__attribute__((always_inline)) inline bool stands_near(const ObjectRay& ray, double reach) noexcept {
  const __m256d direction = magnitudes(_mm256_load_pd(ray.direction)), origin = magnitudes(_mm256_load_pd(ray.origin));
  const __m256d all = _mm256_and_pd(_mm256_cmp_pd(direction, _mm256_set1_pd(kLongest), _CMP_LE_OQ),
                                    _mm256_cmp_pd(origin, _mm256_set1_pd(kNearby * reach), _CMP_LE_OQ));
  return axes_of(all) == 7 && axes_of(_mm256_cmp_pd(direction, _mm256_set1_pd(kShortest), _CMP_GE_OQ)) != 0;
}

// For the longest axis k: the axes k + 1, k + 2, k, k, and values that depend on them.
struct alignas(16) ShearFrame {
  std::int32_t order[4];
  std::uint8_t axes[4];
  std::uint16_t row[4];
};
constexpr ShearFrame kFrames[3] = {
    {{1, 2, 0, 0}, {1, 2, 0, 0}, {32, 64, 0, 0}},
    {{2, 0, 1, 1}, {2, 0, 1, 0}, {64, 0, 32, 0}},
    {{0, 1, 2, 2}, {0, 1, 2, 0}, {0, 32, 64, 0}},
};
// The longest axis, as longest_axis() chooses it, by x > y, y > z, x > z (bits 0, 1, 2).
constexpr std::uint8_t kLongestAxis[8] = {2, 2, 1, 2, 2, 0, 1, 0};

__attribute__((always_inline)) inline void set_states(BoxState& box, TriangleState& triangle, const ObjectRay& ray,
                                                      const TreeExtent& extent) noexcept {
  const __m128 sign_bit = _mm_set1_ps(-0.0f);
  const __m128 origin = _mm256_cvtpd_ps(_mm256_load_pd(ray.origin));
  const __m128 direction = _mm256_cvtpd_ps(_mm256_load_pd(ray.direction));
  const __m128 length = _mm_andnot_ps(sign_bit, direction);
  const __m128 greater = _mm_cmpgt_ps(_mm_shuffle_ps(length, length, _MM_SHUFFLE(3, 0, 1, 0)),
                                      _mm_shuffle_ps(length, length, _MM_SHUFFLE(3, 2, 2, 1)));
  const ShearFrame& frame = kFrames[kLongestAxis[_mm_movemask_ps(greater) & 7]];
  const __m128i order = _mm_load_si128(reinterpret_cast<const __m128i*>(frame.order));
  const __m128i longest = _mm_shuffle_epi32(order, _MM_SHUFFLE(2, 2, 2, 2));

  // As in set_slab_ray().
  const __m128 smallest = _mm_mul_ps(_mm_set1_ps(kSmallestShare), _mm_permutevar_ps(length, longest));
  const __m128 raised = _mm_or_ps(_mm_max_ps(length, smallest), _mm_and_ps(sign_bit, direction));
  const __m128 inverse = _mm_div_ps(_mm_set1_ps(1.0f), raised);
  const __m128 inverse_length = _mm_andnot_ps(sign_bit, inverse);
  const __m128 reach = _mm_add_ps(_mm_loadu_ps(extent.largest), _mm_andnot_ps(sign_bit, origin));
  const __m128 long_reach = _mm_permutevar_ps(reach, longest);
  const __m128 long_depth = _mm_mul_ps(long_reach, _mm_permutevar_ps(inverse_length, longest));
  const __m128 raised_reach = _mm_add_ps(reach, _mm_mul_ps(_mm_set1_ps(kReachShare), long_reach));
  const __m128 slack = _mm_add_ps(_mm_mul_ps(_mm_set1_ps(kPlaneSlack), _mm_mul_ps(raised_reach, inverse_length)),
                                  _mm_mul_ps(_mm_set1_ps(kDepthSlack), long_depth));
  const __m128 at_origin = _mm_mul_ps(origin, inverse);
  // Each store's fourth lane is overwritten by the next one.
  _mm_storeu_ps(box.slab.inverse, inverse);
  _mm_storeu_ps(box.slab.near_offset, _mm_add_ps(at_origin, slack));
  _mm_storeu_ps(box.slab.far_offset, _mm_sub_ps(at_origin, slack));
  const unsigned octant = static_cast<unsigned>(_mm_movemask_ps(inverse)) & 7u;
  box.rows = kOctantRows[octant];

  // As in set_triangle_ray().
  const __m128 along = _mm_permutevar_ps(direction, order);
  const __m128 shear = _mm_mul_ps(along, _mm_permutevar_ps(inverse, longest));
  _mm_storeu_ps(triangle.ray.origin, _mm_permutevar_ps(origin, order));
  _mm_storel_pi(reinterpret_cast<__m64*>(&triangle.ray.shear_x), shear);
  const float direction_z = _mm_cvtss_f32(_mm_movehl_ps(along, along));
  triangle.ray.direction_z = direction_z;
  triangle.ray.depth_slack = kDepthReach * _mm_cvtss_f32(long_depth);
  // The fourth lane is the largest extent, which never exceeds the others' maximum.
  const __m128 reaches = _mm_max_ps(reach, _mm_movehl_ps(reach, reach));
  triangle.ray.edge_slack = kEdgeReach * _mm_cvtss_f32(_mm_max_ss(reaches, _mm_movehdup_ps(reaches)));
  std::memcpy(triangle.ray.axes, frame.axes, sizeof(triangle.ray.axes));
  triangle.ray.runs_down = direction_z < 0.0f;
  std::memcpy(triangle.row, frame.row, sizeof(frame.row));
}

// Gather avx ----------------------------------------------------------------------------------------------------------
// Reads spheres with AVX: one load of four floats each; eight of them are transposed into four rows. Gather
// instructions take more than twice as long.
// Included by each of the translation units that have AVX2; everything in it has internal linkage.

inline __attribute__((always_inline)) __m256 load_two(const Vec3f& low, const Vec3f& high) noexcept {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(&low.x)), _mm_loadu_ps(&high.x), 1);
}

// `ball(lane)` returns the sphere of that lane.
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

// Leaf line avx -------------------------------------------------------------------------------------------------------
// Converts a ray's line to a leaf's steps with AVX, three axes at a time. Equal to leaf_line_scalar.h except for the
// last digit of sums, which the filter's margin allows for.
// Included by each of the translation units that have AVX2; everything in it has internal linkage.

// `slack` is in units of the tree.
inline __attribute__((always_inline)) LeafLine leaf_line(const LeafCorner& corner, const ObjectRay& ray, float t_min,
                                                         float t_limit, float slack) noexcept {
  LeafLine line;
  const __m256d origin = _mm256_load_pd(ray.origin), direction = _mm256_load_pd(ray.direction);
  const __m128 at = _mm_blend_ps(_mm_load_ps(corner.at), _mm_setzero_ps(), 8);
  const __m256d to_corner = _mm256_sub_pd(_mm256_cvtps_pd(at), origin);
  const __m256d pairs = _mm256_hadd_pd(_mm256_mul_pd(to_corner, direction), _mm256_mul_pd(direction, direction));
  const __m128d sums = _mm_add_pd(_mm256_castpd256_pd128(pairs), _mm256_extractf128_pd(pairs, 1));
  const __m128d squared = _mm_unpackhi_pd(sums, sums), t = _mm_div_sd(sums, squared);
  const __m256d steps = _mm256_set1_pd(static_cast<double>(corner.steps));
  const __m256d nearest = _mm256_mul_pd(_mm256_fmsub_pd(_mm256_broadcastsd_pd(t), direction, to_corner), steps);
  const __m128 narrow = _mm256_cvtpd_ps(nearest), sizes = _mm_andnot_ps(_mm_set1_ps(-0.0f), narrow);
  const __m128 larger = _mm_max_ps(sizes, _mm_movehl_ps(sizes, sizes));
  _mm_store_ps(line.nearest, narrow);
  _mm_store_ps(line.direction, _mm256_cvtpd_ps(direction));
  line.away = _mm_cvtss_f32(_mm_max_ss(larger, _mm_shuffle_ps(larger, larger, 1)));
  // Both ends of the range at once.
  const __m128d ends = _mm_cvtps_pd(_mm_setr_ps(t_min, t_limit, 0.0f, 0.0f));
  const __m128d widened = _mm_mul_pd(_mm_andnot_pd(_mm_set1_pd(-0.0), ends), _mm_setr_pd(-0x1p-22, 0x1p-22));
  const __m128d to_depth = _mm_mul_pd(squared, _mm256_castpd256_pd128(steps));
  const __m128d depths = _mm_mul_pd(_mm_add_pd(_mm_sub_pd(ends, _mm_movedup_pd(t)), widened), to_depth);
  const __m128 narrow_depths = _mm_cvtpd_ps(depths);
  line.least = _mm_cvtss_f32(narrow_depths);
  line.most = _mm_cvtss_f32(_mm_movehdup_ps(narrow_depths));
  const __m128 square = _mm_cvtpd_ps(squared);
  line.squared_length = _mm_cvtss_f32(square);
  line.length = _mm_cvtss_f32(_mm_sqrt_ss(square));
  line.slack = slack * corner.steps;
  return line;
}

}  // namespace

}  // namespace perfect_bvh
