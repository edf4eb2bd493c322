// Eight lanes between two steps (math/step_times.h).
// Part of stream_kernel.inl: everything has internal linkage.

struct Shares {
  Float8 earlier, later;
  explicit Shares(const Moment& moment) noexcept : earlier(broadcast(moment.earlier)), later(broadcast(moment.later)) {}
};

PERFECT_BVH_INLINE Float8 interpolate(const Shares& shares, const Float8& a, const Float8& b) noexcept {
  return fmadd(shares.later, b, mul(shares.earlier, a));
}
