// How long a stage took, by the wall clock: for reports, never for decisions.
#pragma once

#include <chrono>

namespace perfect_bvh {

class Stopwatch {
 public:
  [[nodiscard]] double milliseconds() const {
    return std::chrono::duration<double, std::milli>(Clock::now() - start_).count();
  }
  // Since the last lap, or the beginning.
  double lap_milliseconds() {
    const Clock::time_point now = Clock::now();
    const double lap = std::chrono::duration<double, std::milli>(now - lap_start_).count();
    lap_start_ = now;
    return lap;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now(), lap_start_ = start_;
};

}  // namespace perfect_bvh
