// The state of one mesh between commits, and the result of a commit for it.
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

// The caller's expectations for a commit, and the machine's speed.
struct CommitOptions {
  Policy policy = Policy::kGoverned;
  std::optional<double> expected_rays;  // to be cast at the scene after the commit; unknown: trees are chosen without
  Calibration calibration;
};

struct MeshState {
  BuildConfig config;
  Usage usage = Usage::kStatic;
  std::shared_ptr<const Blas> blas;                 // committed; null before the first commit
  std::shared_ptr<const Mesh> edited;               // pending; null if there is no edit
  bool same_topology = false;                       // of `edited` and `blas`
  bool has_deformed = false;                        // since it has these triangles
  std::shared_ptr<SpareTree> spare;                 // null until the mesh is deformed
  std::shared_ptr<SparePositions> spare_positions;  // null until the mesh is deformed
  UpdateHistory history;                            // of `blas`'s tree
  std::optional<double> air;  // empty-space ratio of its triangles' boxes, see measure_air(); empty: not measured

  // Returns the mesh that the caller gave last, committed or not.
  [[nodiscard]] const Mesh& held() const noexcept { return edited ? *edited : blas->mesh; }
};

// A mesh that was edited, or an unedited mesh whose tree may be replaced, and the number of rays that hit its box.
struct ChangedMesh {
  std::int32_t mesh_id;
  const MeshState* state;
  std::optional<double> rays;  // expected before the next commit; unknown: see CommitOptions
  double cast_rays = 0;        // since the last commit
  double served_rays = 0;      // for an unedited mesh: since its tree was built
};

struct BlasResult {
  std::shared_ptr<const Blas> blas;  // null: the mesh keeps its tree
  UpdateHistory history;
  MeshReport report;
};

// Returns whether the mesh did not move since the last commit.
[[nodiscard]] inline bool is_resting(const MeshState& state) noexcept { return state.edited == nullptr; }

// Ledger --------------------------------------------------------------------------------------------------------------
// Rows of a commit's report for a decision: one for each alternative considered.

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

// Returns the actual usage: a mesh that was deformed will be deformed again.
[[nodiscard]] constexpr Usage usage_of(Usage expected, bool deforms) noexcept {
  return deforms && expected == Usage::kStatic ? Usage::kDeforming : expected;
}

// Choose tree ---------------------------------------------------------------------------------------------------------
// Chooses the builder of a mesh's tree, if the choice is left to the engine: the best one that pays off for the number
// of rays, if that is known.
//
// If the caller gives the expected rays, only these count. If none are known, the mesh's usage decides. The rays cast
// since the last commit can then only lead to a better tree than that, because a few test rays do not mean that many
// follow. The tree of an unedited mesh is replaced when the rays cast and expected are enough for another tree to pay
// off. Each replacement uses a better builder, so there are at most two for the same triangles.

// Returns the rays that the new tree will serve if `rays` come before the next commit: as many for each commit that the
// tree is expected to last.
[[nodiscard]] double rays_to_come(Usage usage, double rays) noexcept;

struct TreeChoice {
  BuildConfig config;
  std::vector<Alternative> alternatives;  // empty if there was no choice
};

// Throws Cancelled.
[[nodiscard]] TreeChoice choose_tree(const ChangedMesh& changed, const CommitOptions& options, CancelToken& cancel);

// Returns, for an unedited mesh, the number of rays hitting its box that its tree may serve until building a better one
// pays off. It is a lower bound while the mesh's empty-space ratio is not measured. Infinity if the tree stays: nothing
// is better, or the engine has no choice.
[[nodiscard]] double most_rays_of_tree(const MeshState& state, const CommitOptions& options) noexcept;

// Make blas -----------------------------------------------------------------------------------------------------------
// Makes the tree that a mesh's next snapshot is traced through: builds, refits or keeps it.
// In: the mesh's state, which is not changed, and the commit's options. Out: the tree and its history, with a row of
// the report.

// Returns whether a commit has a decision to make: the mesh was edited, or it rests in a tree that its motion degraded.
[[nodiscard]] bool needs_decision(const MeshState& state, const CommitOptions& options) noexcept;

// Makes the tree of a mesh that needs a decision. Throws Cancelled, bad_alloc.
[[nodiscard]] BlasResult make_blas(const ChangedMesh& changed, const CommitOptions& options, ThreadPool& pool,
                                   CancelToken& cancel);

// The steps of make_blas() ------------------------------------------------------------------------------------------

// Returns whether a resting mesh keeps its tree. If so, the whole result is filled in.
[[nodiscard]] bool keeps_at_rest(const ChangedMesh& resting, const CommitOptions& options, BlasResult& result);

// Makes the tree of `blas` from the tree over the same triangles at their previous positions. Returns false if it
// cannot be refitted, or if the governor chooses another one.
[[nodiscard]] bool refit_blas(Blas& blas, const ChangedMesh& changed, const CommitOptions& options, BlasResult& result,
                              ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
