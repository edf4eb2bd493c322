// Four floats at once: SSE2, which every x86-64 has, or plain loops elsewhere with the same results.
// The fourth lane of a box corner holds another field (see PrimRef, Bvh2Node), so it may have any bits.
#pragma once

#include <cstdint>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace perfect_bvh {

#if defined(__SSE2__)

struct Float4 {
  __m128 v;

  Float4() noexcept = default;
  Float4(__m128 value) noexcept : v(value) {}
  Float4(float x, float y, float z, float w) noexcept : v(_mm_setr_ps(x, y, z, w)) {}
  explicit Float4(float all) noexcept : v(_mm_set1_ps(all)) {}

  [[nodiscard]] static Float4 load(const void* aligned) noexcept {
    return _mm_load_ps(static_cast<const float*>(aligned));
  }
  [[nodiscard]] static Float4 load_unaligned(const void* p) noexcept {
    return _mm_loadu_ps(static_cast<const float*>(p));
  }
  void store(void* aligned) const noexcept { _mm_store_ps(static_cast<float*>(aligned), v); }
  void store_unaligned(void* p) const noexcept { _mm_storeu_ps(static_cast<float*>(p), v); }

  friend Float4 operator+(Float4 a, Float4 b) noexcept { return _mm_add_ps(a.v, b.v); }
  friend Float4 operator-(Float4 a, Float4 b) noexcept { return _mm_sub_ps(a.v, b.v); }
  friend Float4 operator*(Float4 a, Float4 b) noexcept { return _mm_mul_ps(a.v, b.v); }
  friend Float4 operator/(Float4 a, Float4 b) noexcept { return _mm_div_ps(a.v, b.v); }
  // Lane by lane a < b ? a : b (a > b ? a : b): b if either is NaN, b of two zeros.
  friend Float4 min(Float4 a, Float4 b) noexcept { return _mm_min_ps(a.v, b.v); }
  friend Float4 max(Float4 a, Float4 b) noexcept { return _mm_max_ps(a.v, b.v); }

  // Returns the first three lanes, and 0.
  [[nodiscard]] Float4 xyz0() const noexcept { return _mm_and_ps(v, _mm_castsi128_ps(_mm_setr_epi32(-1, -1, -1, 0))); }
  [[nodiscard]] float x() const noexcept { return _mm_cvtss_f32(v); }
  [[nodiscard]] Float4 yzxw() const noexcept { return _mm_shuffle_ps(v, v, _MM_SHUFFLE(3, 0, 2, 1)); }
  [[nodiscard]] Float4 zxyw() const noexcept { return _mm_shuffle_ps(v, v, _MM_SHUFFLE(3, 1, 0, 2)); }
};

struct Int4 {
  __m128i v;

  Int4() noexcept = default;
  Int4(__m128i value) noexcept : v(value) {}
  explicit Int4(std::int32_t all) noexcept : v(_mm_set1_epi32(all)) {}
  Int4(std::int32_t x, std::int32_t y, std::int32_t z, std::int32_t w) noexcept : v(_mm_setr_epi32(x, y, z, w)) {}
  [[nodiscard]] static Int4 load(const void* aligned) noexcept {
    return _mm_load_si128(static_cast<const __m128i*>(aligned));
  }
  void store(void* aligned) const noexcept { _mm_store_si128(static_cast<__m128i*>(aligned), v); }
  [[nodiscard]] static Int4 load_unaligned(const void* p) noexcept {
    return _mm_loadu_si128(static_cast<const __m128i*>(p));
  }
  friend Int4 operator+(Int4 a, Int4 b) noexcept { return _mm_add_epi32(a.v, b.v); }
  friend Int4 operator-(Int4 a, Int4 b) noexcept { return _mm_sub_epi32(a.v, b.v); }
  friend Int4 operator&(Int4 a, Int4 b) noexcept { return _mm_and_si128(a.v, b.v); }
  friend Int4 operator|(Int4 a, Int4 b) noexcept { return _mm_or_si128(a.v, b.v); }
  friend Int4 operator^(Int4 a, Int4 b) noexcept { return _mm_xor_si128(a.v, b.v); }
  friend Int4 operator<<(Int4 a, int bits) noexcept { return _mm_slli_epi32(a.v, bits); }
  friend Int4 operator>>(Int4 a, int bits) noexcept { return _mm_srli_epi32(a.v, bits); }  // zeros come in
  // Lane by lane a > b ? all bits : none.
  friend Int4 greater(Int4 a, Int4 b) noexcept { return _mm_cmpgt_epi32(a.v, b.v); }
};

// -1 in the lanes where a < b, 0 in the others.
[[nodiscard]] inline Int4 less(Float4 a, Float4 b) noexcept { return _mm_castps_si128(_mm_cmplt_ps(a.v, b.v)); }
// Returns bit i set if lane i of both is the same.
[[nodiscard]] inline std::uint32_t equal_lanes(Int4 a, Int4 b) noexcept {
  return static_cast<std::uint32_t>(_mm_movemask_ps(_mm_castsi128_ps(_mm_cmpeq_epi32(a.v, b.v))));
}
[[nodiscard]] inline Int4 bits_of(Float4 a) noexcept { return _mm_castps_si128(a.v); }
[[nodiscard]] inline Float4 from_bits(Int4 a) noexcept { return _mm_castsi128_ps(a.v); }
// Swaps rows and columns.
inline void transpose(Float4& a, Float4& b, Float4& c, Float4& d) noexcept { _MM_TRANSPOSE4_PS(a.v, b.v, c.v, d.v); }

// Loads three floats from any address, and 0.
[[nodiscard]] inline Float4 load_xyz(const void* p) noexcept {
  const __m128 xy = _mm_castsi128_ps(_mm_loadl_epi64(static_cast<const __m128i*>(p)));
  return _mm_movelh_ps(xy, _mm_load_ss(static_cast<const float*>(p) + 2));
}
[[nodiscard]] inline Float4 to_float(Int4 a) noexcept { return _mm_cvtepi32_ps(a.v); }
// Rounds towards zero; the values must fit.
[[nodiscard]] inline Int4 truncate(Float4 a) noexcept { return _mm_cvttps_epi32(a.v); }
// Lane by lane a < b ? x : y.
[[nodiscard]] inline Float4 select_less(Float4 a, Float4 b, Float4 x, Float4 y) noexcept {
  const __m128 less = _mm_cmplt_ps(a.v, b.v);
  return _mm_or_ps(_mm_and_ps(less, x.v), _mm_andnot_ps(less, y.v));
}

#else

struct Float4 {
  float v[4];

  Float4() noexcept = default;
  Float4(float x, float y, float z, float w) noexcept : v{x, y, z, w} {}
  explicit Float4(float all) noexcept : v{all, all, all, all} {}

  [[nodiscard]] static Float4 load(const void* p) noexcept { return load_unaligned(p); }
  [[nodiscard]] static Float4 load_unaligned(const void* p) noexcept {
    Float4 result;
    __builtin_memcpy(result.v, p, sizeof(result.v));
    return result;
  }
  void store(void* p) const noexcept { __builtin_memcpy(p, v, sizeof(v)); }
  void store_unaligned(void* p) const noexcept { store(p); }

  friend Float4 operator+(Float4 a, Float4 b) noexcept {
    return {a.v[0] + b.v[0], a.v[1] + b.v[1], a.v[2] + b.v[2], a.v[3] + b.v[3]};
  }
  friend Float4 operator-(Float4 a, Float4 b) noexcept {
    return {a.v[0] - b.v[0], a.v[1] - b.v[1], a.v[2] - b.v[2], a.v[3] - b.v[3]};
  }
  friend Float4 operator*(Float4 a, Float4 b) noexcept {
    return {a.v[0] * b.v[0], a.v[1] * b.v[1], a.v[2] * b.v[2], a.v[3] * b.v[3]};
  }
  friend Float4 operator/(Float4 a, Float4 b) noexcept {
    return {a.v[0] / b.v[0], a.v[1] / b.v[1], a.v[2] / b.v[2], a.v[3] / b.v[3]};
  }
  friend Float4 min(Float4 a, Float4 b) noexcept {
    for (int i = 0; i < 4; ++i) a.v[i] = a.v[i] < b.v[i] ? a.v[i] : b.v[i];
    return a;
  }
  friend Float4 max(Float4 a, Float4 b) noexcept {
    for (int i = 0; i < 4; ++i) a.v[i] = a.v[i] > b.v[i] ? a.v[i] : b.v[i];
    return a;
  }

  [[nodiscard]] Float4 xyz0() const noexcept { return {v[0], v[1], v[2], 0.0f}; }
  [[nodiscard]] float x() const noexcept { return v[0]; }
  [[nodiscard]] Float4 yzxw() const noexcept { return {v[1], v[2], v[0], v[3]}; }
  [[nodiscard]] Float4 zxyw() const noexcept { return {v[2], v[0], v[1], v[3]}; }
};

struct Int4 {
  std::int32_t v[4];

  Int4() noexcept = default;
  Int4(std::int32_t x, std::int32_t y, std::int32_t z, std::int32_t w) noexcept : v{x, y, z, w} {}
  explicit Int4(std::int32_t all) noexcept : v{all, all, all, all} {}
  [[nodiscard]] static Int4 load(const void* p) noexcept {
    Int4 result;
    __builtin_memcpy(result.v, p, sizeof(result.v));
    return result;
  }
  void store(void* p) const noexcept { __builtin_memcpy(p, v, sizeof(v)); }
  [[nodiscard]] static Int4 load_unaligned(const void* p) noexcept { return load(p); }
  template <class Operation>
  [[nodiscard]] static Int4 lanewise(Int4 a, Int4 b, Operation operation) noexcept {
    for (int i = 0; i < 4; ++i) {
      a.v[i] =
          static_cast<std::int32_t>(operation(static_cast<std::uint32_t>(a.v[i]), static_cast<std::uint32_t>(b.v[i])));
    }
    return a;
  }
  friend Int4 operator+(Int4 a, Int4 b) noexcept {
    return lanewise(a, b, [](std::uint32_t x, std::uint32_t y) { return x + y; });
  }
  friend Int4 operator-(Int4 a, Int4 b) noexcept {
    return lanewise(a, b, [](std::uint32_t x, std::uint32_t y) { return x - y; });
  }
  friend Int4 operator&(Int4 a, Int4 b) noexcept {
    return lanewise(a, b, [](std::uint32_t x, std::uint32_t y) { return x & y; });
  }
  friend Int4 operator|(Int4 a, Int4 b) noexcept {
    return lanewise(a, b, [](std::uint32_t x, std::uint32_t y) { return x | y; });
  }
  friend Int4 operator^(Int4 a, Int4 b) noexcept {
    return lanewise(a, b, [](std::uint32_t x, std::uint32_t y) { return x ^ y; });
  }
  friend Int4 operator<<(Int4 a, int bits) noexcept {
    return lanewise(a, a, [bits](std::uint32_t x, std::uint32_t) { return x << bits; });
  }
  friend Int4 operator>>(Int4 a, int bits) noexcept {  // zeros come in
    return lanewise(a, a, [bits](std::uint32_t x, std::uint32_t) { return x >> bits; });
  }
  // Lane by lane a > b ? all bits : none.
  friend Int4 greater(Int4 a, Int4 b) noexcept {
    for (int i = 0; i < 4; ++i) a.v[i] = a.v[i] > b.v[i] ? -1 : 0;
    return a;
  }
};

[[nodiscard]] inline Int4 less(Float4 a, Float4 b) noexcept {
  const auto lane = [&](int i) { return a.v[i] < b.v[i] ? -1 : 0; };
  return {lane(0), lane(1), lane(2), lane(3)};
}
[[nodiscard]] inline std::uint32_t equal_lanes(Int4 a, Int4 b) noexcept {
  std::uint32_t lanes = 0;
  for (std::uint32_t i = 0; i < 4; ++i) lanes |= (a.v[i] == b.v[i] ? 1u : 0u) << i;
  return lanes;
}
[[nodiscard]] inline Int4 bits_of(Float4 a) noexcept { return Int4::load(a.v); }
[[nodiscard]] inline Float4 from_bits(Int4 a) noexcept { return Float4::load(a.v); }
// Swaps rows and columns.
inline void transpose(Float4& a, Float4& b, Float4& c, Float4& d) noexcept {
  const Float4 rows[4] = {a, b, c, d};
  for (int i = 0; i < 4; ++i)
    a.v[i] = rows[i].v[0], b.v[i] = rows[i].v[1], c.v[i] = rows[i].v[2], d.v[i] = rows[i].v[3];
}

[[nodiscard]] inline Float4 load_xyz(const void* p) noexcept {
  Float4 result(0.0f);
  __builtin_memcpy(result.v, p, 3 * sizeof(float));
  return result;
}
[[nodiscard]] inline Float4 to_float(Int4 a) noexcept {
  return {static_cast<float>(a.v[0]), static_cast<float>(a.v[1]), static_cast<float>(a.v[2]),
          static_cast<float>(a.v[3])};
}
[[nodiscard]] inline Int4 truncate(Float4 a) noexcept {
  return {static_cast<std::int32_t>(a.v[0]), static_cast<std::int32_t>(a.v[1]), static_cast<std::int32_t>(a.v[2]),
          static_cast<std::int32_t>(a.v[3])};
}
[[nodiscard]] inline Float4 select_less(Float4 a, Float4 b, Float4 x, Float4 y) noexcept {
  for (int i = 0; i < 4; ++i) x.v[i] = a.v[i] < b.v[i] ? x.v[i] : y.v[i];
  return x;
}

#endif

// Replaces the lowest bits of floats by a number. The smallest of several non-negative ones then also identifies
// itself.
[[nodiscard]] inline Float4 tagged(Float4 value, Int4 mask, Int4 tag) noexcept {
  return from_bits((bits_of(value) & (mask ^ Int4(-1))) | tag);
}

// A box with one register for each corner.
struct Box4 {
  Float4 lower;
  Float4 upper;

  [[nodiscard]] static Box4 empty() noexcept { return {Float4(__builtin_inff()), Float4(-__builtin_inff())}; }
  // `corners`: lower x y z *, upper x y z *, 16-byte aligned.
  [[nodiscard]] static Box4 load(const void* corners) noexcept {
    return {Float4::load(corners), Float4::load(static_cast<const float*>(corners) + 4)};
  }
  // The fourth lane is 0: if it held the difference of two primitives' numbers, arithmetic would have denormals, which
  // can be 100 times slower.
  [[nodiscard]] Float4 extent() const noexcept { return (upper - lower).xyz0(); }
  void grow(const Box4& box) noexcept { lower = min(box.lower, lower), upper = max(box.upper, upper); }
  void grow(Float4 point) noexcept { lower = min(point, lower), upper = max(point, upper); }
};

// Half the surface area of a box with these extents.
[[nodiscard]] inline float half_area(Float4 extent) noexcept {
  const Float4 products = extent * extent.yzxw();  // xy yz zx
  return (products + products.yzxw() + products.zxyw()).x();
}

}  // namespace perfect_bvh
