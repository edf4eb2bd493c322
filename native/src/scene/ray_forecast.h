// How many rays a commit reckons with.
//
// What the caller expects counts. A commit that is told nothing expects what the last one did that was told, or what
// was cast since the last commit if that is more. Where none was ever told the number stays unknown: trees are chosen
// by usage, and what was cast is kept apart, see choose_tree.h. To expect none says nothing of later commits.
#pragma once

#include <cstdint>
#include <optional>

namespace perfect_bvh {

struct RayForecast {
  std::optional<double> expected;  // before the next commit
  double cast = 0;                 // since the last one
  std::uint64_t cast_in_all = 0;   // until now

  [[nodiscard]] double likely() const noexcept { return expected.value_or(cast); }
};

}  // namespace perfect_bvh
