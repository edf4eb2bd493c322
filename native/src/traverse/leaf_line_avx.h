// A ray's line in a leaf's steps with AVX: three axes at a time, as leaf_line_scalar.h finds it but for the last digit
// of sums, which the filter's margin allows for.
// Included by each of the translation units that have AVX2; everything in it has internal linkage.
#pragma once

#include <immintrin.h>

#include "traverse/leaf_line.h"
#include "traverse/object_ray.h"

namespace perfect_bvh {
namespace {

// `slack`: in units of the tree.
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
