// When the steps of a motion are reached.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "math/step_times.h"

namespace perfect_bvh::bindings {

// The first and the last are reached at the ends of the range.
inline StepTimes step_times(std::size_t steps, const std::pair<float, float>& range) {
  const auto last = static_cast<std::uint32_t>(steps - 1);
  return {range.first, static_cast<float>(last) / (range.second - range.first), last};
}

}  // namespace perfect_bvh::bindings
