// What a scene knows of one mesh from commit to commit, and what a commit makes of it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "blas/blas.h"
#include "blas/build_tree.h"
#include "blas/moved_mesh.h"
#include "builders/builder.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "stats/statistics.h"
#include "update/governor.h"

namespace perfect_bvh {

// What the caller of a commit knows of the time to come, and what the machine is like.
struct CommitOptions {
  Policy policy = Policy::kGoverned;
  std::optional<double> expected_rays;  // about to be cast at the scene; unknown: trees are chosen without
  Calibration calibration;
};

struct MeshState {
  BuildConfig config;
  Usage usage = Usage::kStatic;
  std::shared_ptr<const Blas> blas;                 // committed; null before the first commit
  std::shared_ptr<const Mesh> edited;               // waiting; null if nothing is
  bool same_topology = false;                       // of `edited` and `blas`
  bool has_deformed = false;                        // since it has its triangles
  std::shared_ptr<SpareTree> spare;                 // null until the mesh is deformed
  std::shared_ptr<SparePositions> spare_positions;  // likewise
  UpdateHistory history;                            // of `blas`'s tree
  std::optional<double> air;                        // in its triangles' boxes, see measure_air(); empty: not measured

  // What the caller gave last, committed or not.
  [[nodiscard]] const Mesh& held() const noexcept { return edited ? *edited : blas->mesh; }
};

// A mesh that was edited, or rests in a tree that may be replaced, and how many rays meet its box.
struct ChangedMesh {
  std::int32_t mesh_id;
  const MeshState* state;
  std::optional<double> rays;  // expected before the next commit; unknown: see CommitOptions
  double cast_rays = 0;        // since the last commit
  double served_rays = 0;      // of one that rests: since its tree was built
};

struct BlasResult {
  std::shared_ptr<const Blas> blas;  // null: the mesh keeps what it has
  UpdateHistory history;
  MeshReport report;
};

// The mesh did not move since the last commit.
[[nodiscard]] inline bool is_resting(const MeshState& state) noexcept { return state.edited == nullptr; }

// Ledger --------------------------------------------------------------------------------------------------------------
// What a commit's report says of a decision: a row for each alternative that was weighed.

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

// Choose tree ---------------------------------------------------------------------------------------------------------
// Which builder makes a mesh's tree where that is left to the engine: what the rays repay, as far as they are known.
//
// Rays that a caller expects decide alone. Where none are known, a mesh's usage does; the rays that were cast since the
// last commit then only ever lead to a better tree than that, as a few to try something out promise no end of rays. A
// tree that its mesh rests in is replaced once more rays than repay another have come or are to come. Each step leads
// to a better builder, so there are at most two for the same triangles.

// In the tree that there will be, if so many come before the next commit: as many for each commit that it is expected
// to serve.
[[nodiscard]] double rays_to_come(Usage usage, double rays) noexcept;

struct TreeChoice {
  BuildConfig config;
  std::vector<Alternative> alternatives;  // empty where there was no choice
};

// Throws Cancelled.
[[nodiscard]] TreeChoice choose_tree(const ChangedMesh& changed, const CommitOptions& options, CancelToken& cancel);

// Of a mesh that rests: how many rays, of those that meet its box, its tree may serve until a better one repays being
// built instead; no fewer than that while the mesh's air is not measured. Infinity where it stays: nothing is better,
// or the engine has no choice.
[[nodiscard]] double most_rays_of_tree(const MeshState& state, const CommitOptions& options) noexcept;

// Make blas -----------------------------------------------------------------------------------------------------------
// From a mesh's state to the tree that its next snapshot is traced through: built, refitted or kept.
// In: the state, which stays as it is; what the commit knows. Out: the tree and its history, with a row of the report.

// Whether a commit has anything to decide: the mesh was edited, or rests in a tree that its motion degraded.
[[nodiscard]] bool needs_decision(const MeshState& state, const CommitOptions& options) noexcept;

// Of a mesh that needs a decision. Throws Cancelled, bad_alloc.
[[nodiscard]] BlasResult make_blas(const ChangedMesh& changed, const CommitOptions& options, ThreadPool& pool,
                                   CancelToken& cancel);

// The steps of make_blas() ------------------------------------------------------------------------------------------

// Whether a resting mesh keeps its tree; all of the result is then filled in.
[[nodiscard]] bool keeps_at_rest(const ChangedMesh& resting, const CommitOptions& options, BlasResult& result);

// Makes the tree of `blas` from that over the same triangles where they were before. False if it cannot
// be refitted, or the governor wants another one.
[[nodiscard]] bool refit_blas(Blas& blas, const ChangedMesh& changed, const CommitOptions& options, BlasResult& result,
                              ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
