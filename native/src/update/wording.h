// How decisions are put into words.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>

#include "update/governor.h"

namespace perfect_bvh {

// "1.3"; what is beyond all measure is cut off.
[[nodiscard]] inline std::string with_tenths(double value) {
  const auto tenths = static_cast<long long>(std::clamp(value, 0.0, 1e12) * 10.0 + 0.5);
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10);
}

// Two digits, all that stand before the point: "121", "12", "1.2", "0.12".
[[nodiscard]] inline std::string with_two_digits(double value) {
  if (value >= 9.95) return std::to_string(static_cast<long long>(std::min(value, 1e12) + 0.5));
  if (value >= 0.995) return with_tenths(value);
  const auto hundredths = static_cast<int>(std::max(value, 0.0) * 100.0 + 0.5);
  return "0." + std::to_string(hundredths / 10) + std::to_string(hundredths % 10);
}

// What rounds to no hundredth of a millisecond.
[[nodiscard]] inline bool is_next_to_nothing(double nanoseconds) { return nanoseconds < 5e3; }

// "under 0.01 ms", "0.28 ms", "12 ms", "0.28 s" or "121 s".
[[nodiscard]] inline std::string as_time(double nanoseconds) {
  if (is_next_to_nothing(nanoseconds)) return "under 0.01 ms";
  if (nanoseconds < 99.5e6) return with_two_digits(nanoseconds * 1e-6) + " ms";
  return with_two_digits(nanoseconds * 1e-9) + " s";
}

[[nodiscard]] inline const char* verb_of(UpdateAction action) {
  constexpr std::array<const char*, 5> kVerbs{"refit", "rotate", "rebuild parts", "rebuild", "keep"};
  return kVerbs[static_cast<std::size_t>(action)];
}

}  // namespace perfect_bvh
