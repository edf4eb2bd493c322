// Vectors of doubles: fixed operations lane by lane, the same bits on every instruction set.
#pragma once

namespace perfect_bvh {

// Functions with vectors are always inlined, so no vector is ever passed to a function.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

// GCC and Clang map these to the vectors of the translation unit's instruction set.
using Double2 = double __attribute__((vector_size(16)));
using Double4 = double __attribute__((vector_size(32)));
using Float4Lanes = float __attribute__((vector_size(16)));
using Mask4 = long long __attribute__((vector_size(32)));

#define PERFECT_BVH_LANES static inline __attribute__((always_inline))

PERFECT_BVH_LANES Double4 all4(double x) noexcept { return Double4{x, x, x, x}; }
// Loads from any address.
PERFECT_BVH_LANES Double4 load4(const double* p) noexcept {
  Double4 v;
  __builtin_memcpy(&v, p, sizeof(v));
  return v;
}
// Loads four floats from any address.
PERFECT_BVH_LANES Double4 load4_widened(const void* p) noexcept {
  Float4Lanes v;
  __builtin_memcpy(&v, p, sizeof(v));
  return __builtin_convertvector(v, Double4);
}
PERFECT_BVH_LANES void store4(double* p, const Double4& v) noexcept { __builtin_memcpy(p, &v, sizeof(v)); }
// Sets the fourth lane to 0.
PERFECT_BVH_LANES Double4 three_of(const Double4& v) noexcept {
  const Mask4 mask = {-1, -1, -1, 0};
  return __builtin_bit_cast(Double4, __builtin_bit_cast(Mask4, v) & mask);
}

}  // namespace perfect_bvh
