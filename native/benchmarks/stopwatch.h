// Times and their statistics.
#pragma once

#include <time.h>

#include <algorithm>
#include <vector>

namespace perfect_bvh::bench {

[[nodiscard]] inline double seconds_on(clockid_t clock) {
  timespec now;
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Returns the thread's own CPU time for one thread, which other load does not affect, and wall-clock time for several
// threads.
[[nodiscard]] inline double seconds(int thread_count) {
  return seconds_on(thread_count == 1 ? CLOCK_THREAD_CPUTIME_ID : CLOCK_MONOTONIC);
}

// The median and the lower and upper quartiles of the measurements.
struct Spread {
  double median = 0, low = 0, high = 0;

  [[nodiscard]] static Spread of(std::vector<double> values) {
    if (values.empty()) return {};
    std::sort(values.begin(), values.end());
    const std::size_t last = values.size() - 1;
    return {values[values.size() / 2], values[last / 4], values[last - last / 4]};
  }
};

}  // namespace perfect_bvh::bench
