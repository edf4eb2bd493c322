// Checks whether a machine is quiet enough for measurements.
#pragma once

#include <cstdio>
#include <string>

namespace perfect_bvh::bench {

// Mean number of running or runnable processes in the last minute. A benchmark that has just run is one of them.
inline constexpr double kMostLoad = 1.2;

// Returns a sentence that says why not to measure, or nothing.
[[nodiscard]] inline std::string objection_to_load(double load, bool is_noisy) {
  if (is_noisy || load <= kMostLoad) return "";
  char text[160];
  std::snprintf(text, sizeof(text),
                "the load is %.2f, above %.1f: wait until the machine is quiet, or measure all the same with --noisy",
                load, kMostLoad);
  return text;
}

}  // namespace perfect_bvh::bench
