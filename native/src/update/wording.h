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

[[nodiscard]] inline std::string as_milliseconds(double nanoseconds) { return with_tenths(nanoseconds * 1e-6) + " ms"; }

[[nodiscard]] inline const char* verb_of(UpdateAction action) {
  constexpr std::array<const char*, 5> kVerbs{"refit", "rotate", "rebuild parts", "rebuild", "keep"};
  return kVerbs[static_cast<std::size_t>(action)];
}

}  // namespace perfect_bvh
