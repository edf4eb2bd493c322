// Whether a machine is quiet enough to be measured on.
#pragma once

#include <cstdio>
#include <string>

namespace perfect_bvh::bench {

// Processes that run or want to, in the mean of the last minute. A benchmark that has just run is one of them.
inline constexpr double kMostLoad = 1.2;

// The sentence that says why not to measure; nothing if nothing speaks against it.
[[nodiscard]] inline std::string objection_to_load(double load, bool is_noisy) {
  if (is_noisy || load <= kMostLoad) return "";
  char text[160];
  std::snprintf(text, sizeof(text),
                "the load is %.2f, above %.1f: wait until the machine is quiet, or measure all the same with --noisy",
                load, kMostLoad);
  return text;
}

}  // namespace perfect_bvh::bench
