// What a commit's report says of a decision: a row for each alternative that was weighed.
#pragma once

#include <vector>

#include "blas/build_tree.h"
#include "stats/commit_report.h"
#include "update/governor.h"

namespace perfect_bvh {

[[nodiscard]] constexpr MeshAction action_of(UpdateAction action) noexcept {
  switch (action) {
    case UpdateAction::kRefit:
      return MeshAction::kRefitted;
    case UpdateAction::kRotate:
      return MeshAction::kRotated;
    case UpdateAction::kRebuildParts:
      return MeshAction::kPartlyRebuilt;
    case UpdateAction::kRebuild:
      return MeshAction::kRebuilt;
    case UpdateAction::kKeep:
      return MeshAction::kKept;
  }
  return MeshAction::kRebuilt;
}

inline void note(MeshReport& report, const std::vector<Alternative>& alternatives) {
  const bool is_first = report.action == MeshAction::kBuilt;
  for (const Alternative& alternative : alternatives) {
    AlternativeReport row;
    row.action = is_first ? MeshAction::kBuilt : action_of(alternative.action);
    if (alternative.action == UpdateAction::kRebuild) row.builder = builder_name(alternative.builder);
    row.update_milliseconds = alternative.update_nanoseconds * 1e-6;
    if (alternative.trace_nanoseconds) row.trace_milliseconds = *alternative.trace_nanoseconds * 1e-6;
    report.alternatives.push_back(std::move(row));
  }
}

// What a mesh turned out to be: one that was deformed will be so again.
[[nodiscard]] constexpr Usage usage_of(Usage expected, bool deforms) noexcept {
  return deforms && expected == Usage::kStatic ? Usage::kDeforming : expected;
}

}  // namespace perfect_bvh
