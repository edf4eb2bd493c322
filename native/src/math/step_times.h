// What moves is known at evenly spaced moments, its steps; between two of them it is interpolated, before the first and
// after the last it stands still.
//
// Positions go in straight lines, and boxes with them: both are interpolated by the same operations, fl(later * b +
// fl(earlier * a)), which grow with a and with b, whatever is rounded. So where a box holds a vertex at both steps, it
// holds it at every time between, as computed; and at a step itself nothing is interpolated.
#pragma once

#include <cstdint>

namespace perfect_bvh {

struct StepTimes {
  float begin = 0.0f;
  float rate = 1.0f;  // steps per unit of time
  std::uint32_t last = 0;
};

// At a step, or between it and the next: by shares that add up to 1, neither 0. At a step: 1 and 0.
struct Moment {
  std::uint32_t step = 0;
  float earlier = 1.0f, later = 0.0f;

  [[nodiscard]] bool is_between() const noexcept { return later != 0.0f; }
};

// Kernels include this file: nothing in it may have external linkage. No time is NaN.
static inline __attribute__((always_inline)) Moment moment_at(const StepTimes& times, float time) noexcept {
  const float at = (time - times.begin) * times.rate;
  if (!(at > 0.0f)) return {};
  if (at >= static_cast<float>(times.last)) return {times.last, 1.0f, 0.0f};
  const auto step = static_cast<std::uint32_t>(at);
  const float later = at - static_cast<float>(step);
  return {step, 1.0f - later, later};
}

static inline float interpolate(const Moment& moment, float a, float b) noexcept {
  return __builtin_fmaf(moment.later, b, moment.earlier * a);
}

// When a step is reached.
static inline double time_of(const StepTimes& times, std::uint32_t step) noexcept {
  return static_cast<double>(times.begin) + static_cast<double>(step) / static_cast<double>(times.rate);
}

}  // namespace perfect_bvh
