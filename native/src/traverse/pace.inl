// Counts a kernel's steps between two checks whether to stop. Steps are cheaper than a clock: two instructions per
// step.
// Part of stream_kernel.inl: everything has internal linkage.

class Pace {
 public:
  explicit Pace(const Interruption& interruption) noexcept : interruption_(&interruption) {}

  // Call before each step. Once true, it stays true, so nested loops unwind one after the other.
  PERFECT_BVH_INLINE bool should_stop() noexcept { return --left_ == 0 && ask(); }

 private:
  __attribute__((noinline)) bool ask() noexcept {
    const bool stops = interruption_->should_stop != nullptr && interruption_->should_stop(interruption_->context);
    left_ = stops ? 1 : kStepsBetweenAsking;
    return stops;
  }

  const Interruption* interruption_;
  std::uint32_t left_ = kStepsBetweenAsking;
};
