// t of one triangle's plane with AVX: plane_t() of plane_of(), three axes at a time. The same operations, so the same
// bits. Included by each of the translation units that have AVX2; everything in it has internal linkage.
#pragma once

#include <immintrin.h>

namespace perfect_bvh {
namespace {

// `at(corner, axis)`: the corners' coordinates. origin, direction: four doubles, aligned, the last 0.
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

}  // namespace
}  // namespace perfect_bvh
