// Eight 16-bit integers at once: SSE2, which every x86-64 has, or plain loops elsewhere with the same results.
#pragma once

#include <cmath>
#include <cstdint>

#include "math/float4.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace perfect_bvh {

#if defined(__SSE2__)

struct Short8 {
  __m128i v;

  Short8() noexcept = default;
  Short8(__m128i value) noexcept : v(value) {}
  explicit Short8(std::int16_t all) noexcept : v(_mm_set1_epi16(all)) {}

  [[nodiscard]] static Short8 load(const void* aligned) noexcept {
    return _mm_load_si128(static_cast<const __m128i*>(aligned));
  }
  void store(void* aligned) const noexcept { _mm_store_si128(static_cast<__m128i*>(aligned), v); }

  friend Short8 operator+(Short8 a, Short8 b) noexcept { return _mm_add_epi16(a.v, b.v); }
  friend Short8 operator-(Short8 a, Short8 b) noexcept { return _mm_sub_epi16(a.v, b.v); }
  friend Short8 min(Short8 a, Short8 b) noexcept { return _mm_min_epi16(a.v, b.v); }
  friend Short8 max(Short8 a, Short8 b) noexcept { return _mm_max_epi16(a.v, b.v); }
  // Returns the upper 16 bits of the products of unsigned lanes.
  friend Short8 multiply_high(Short8 a, Short8 b) noexcept { return _mm_mulhi_epu16(a.v, b.v); }

  // Moves lanes 4..7 to 0..3, and sets 4..7 to zero.
  [[nodiscard]] Short8 upper_half() const noexcept { return _mm_srli_si128(v, 8); }
  // Returns a lane as an unsigned number.
  template <int Lane>
  [[nodiscard]] std::uint32_t lane() const noexcept {
    return static_cast<std::uint32_t>(_mm_extract_epi16(v, Lane));
  }
  template <int Lane>
  [[nodiscard]] Short8 with_lane(std::uint32_t value) const noexcept {
    return _mm_insert_epi16(v, static_cast<int>(value), Lane);
  }
};

// Rounds eight numbers to the nearest integers, which must fit.
[[nodiscard]] inline Short8 round_to_short(Float4 first, Float4 second) noexcept {
  return _mm_packs_epi32(_mm_cvtps_epi32(first.v), _mm_cvtps_epi32(second.v));
}

// Returns xy + yz + zx of the first three lanes, each at most 2^14 in magnitude.
[[nodiscard]] inline std::uint32_t sum_of_products(Short8 a) noexcept {
  const __m128i xyz = _mm_and_si128(a.v, _mm_setr_epi16(-1, -1, -1, 0, 0, 0, 0, 0));
  const __m128i sums = _mm_madd_epi16(xyz, _mm_shufflelo_epi16(a.v, _MM_SHUFFLE(3, 0, 2, 1)));  // xy + yz, zx
  return static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm_add_epi32(sums, _mm_srli_si128(sums, 4))));
}
// Converts lanes 0..3, which must not be negative.
[[nodiscard]] inline Float4 lanes_to_float(Short8 a) noexcept {
  return _mm_cvtepi32_ps(_mm_unpacklo_epi16(a.v, _mm_setzero_si128()));
}
// Packs lanes 0..3, from 0..65535, as unsigned numbers; the other lanes are 0.
[[nodiscard]] inline Short8 to_unsigned_lanes(Int4 a) noexcept {
  const __m128i signed_lanes = _mm_srai_epi32(_mm_slli_epi32(a.v, 16), 16);  // so that packing does not saturate
  return _mm_packs_epi32(signed_lanes, _mm_setzero_si128());
}
// Does sum_of_products() for three at once; the fourth lane is 0.
[[nodiscard]] inline Int4 sums_of_products(Short8 a, Short8 b, Short8 c) noexcept {
  const __m128i mask = _mm_setr_epi16(-1, -1, -1, 0, 0, 0, 0, 0);
  const auto products = [mask](Short8 s) {  // xy + yz, zx
    return _mm_madd_epi16(_mm_and_si128(s.v, mask), _mm_shufflelo_epi16(s.v, _MM_SHUFFLE(3, 0, 2, 1)));
  };
  const __m128i ab = _mm_unpacklo_epi32(products(a), products(b));
  const __m128i c0 = _mm_unpacklo_epi32(products(c), _mm_setzero_si128());
  return _mm_add_epi32(_mm_unpacklo_epi64(ab, c0), _mm_unpackhi_epi64(ab, c0));
}

#else

struct Short8 {
  std::int16_t v[8];

  Short8() noexcept = default;
  explicit Short8(std::int16_t all) noexcept : v{all, all, all, all, all, all, all, all} {}

  [[nodiscard]] static Short8 load(const void* p) noexcept {
    Short8 result;
    __builtin_memcpy(result.v, p, sizeof(result.v));
    return result;
  }
  void store(void* p) const noexcept { __builtin_memcpy(p, v, sizeof(v)); }

  template <class Op>
  [[nodiscard]] static Short8 lanewise(Short8 a, Short8 b, Op op) noexcept {
    for (int i = 0; i < 8; ++i) a.v[i] = static_cast<std::int16_t>(op(a.v[i], b.v[i]));
    return a;
  }
  friend Short8 operator+(Short8 a, Short8 b) noexcept {
    return lanewise(a, b, [](int x, int y) { return x + y; });
  }
  friend Short8 operator-(Short8 a, Short8 b) noexcept {
    return lanewise(a, b, [](int x, int y) { return x - y; });
  }
  friend Short8 min(Short8 a, Short8 b) noexcept {
    return lanewise(a, b, [](int x, int y) { return x < y ? x : y; });
  }
  friend Short8 max(Short8 a, Short8 b) noexcept {
    return lanewise(a, b, [](int x, int y) { return x > y ? x : y; });
  }
  friend Short8 multiply_high(Short8 a, Short8 b) noexcept {
    return lanewise(a, b, [](int x, int y) {
      return (static_cast<std::uint32_t>(x & 0xFFFF) * static_cast<std::uint32_t>(y & 0xFFFF)) >> 16;
    });
  }

  [[nodiscard]] Short8 upper_half() const noexcept {
    Short8 result(0);
    for (int i = 0; i < 4; ++i) result.v[i] = v[i + 4];
    return result;
  }
  template <int Lane>
  [[nodiscard]] std::uint32_t lane() const noexcept {
    return static_cast<std::uint16_t>(v[Lane]);
  }
  template <int Lane>
  [[nodiscard]] Short8 with_lane(std::uint32_t value) const noexcept {
    Short8 result = *this;
    result.v[Lane] = static_cast<std::int16_t>(value);
    return result;
  }
};

[[nodiscard]] inline Short8 round_to_short(Float4 first, Float4 second) noexcept {
  Short8 result;
  for (int i = 0; i < 4; ++i) {
    result.v[i] = static_cast<std::int16_t>(std::nearbyint(first.v[i]));
    result.v[i + 4] = static_cast<std::int16_t>(std::nearbyint(second.v[i]));
  }
  return result;
}

[[nodiscard]] inline std::uint32_t sum_of_products(Short8 a) noexcept {
  return static_cast<std::uint32_t>(a.v[0] * a.v[1] + a.v[1] * a.v[2] + a.v[2] * a.v[0]);
}

[[nodiscard]] inline Short8 to_unsigned_lanes(Int4 a) noexcept {
  Short8 result(0);
  for (int i = 0; i < 4; ++i) result.v[i] = static_cast<std::int16_t>(a.v[i]);
  return result;
}
[[nodiscard]] inline Float4 lanes_to_float(Short8 a) noexcept {
  const auto lane = [a](int i) { return static_cast<float>(static_cast<std::uint16_t>(a.v[i])); };
  return {lane(0), lane(1), lane(2), lane(3)};
}
[[nodiscard]] inline Int4 sums_of_products(Short8 a, Short8 b, Short8 c) noexcept {
  return {static_cast<std::int32_t>(sum_of_products(a)), static_cast<std::int32_t>(sum_of_products(b)),
          static_cast<std::int32_t>(sum_of_products(c)), 0};
}

#endif

}  // namespace perfect_bvh
