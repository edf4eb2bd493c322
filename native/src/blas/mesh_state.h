// What a scene knows of one mesh from commit to commit, and what a commit makes of it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "blas/blas.h"
#include "blas/build_tree.h"
#include "blas/moved_mesh.h"
#include "builders/build_config.h"
#include "stats/commit_report.h"
#include "update/calibration.h"
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
  bool is_lazy = false;
  std::shared_ptr<const Blas> blas;                 // committed; null before the first commit
  std::shared_ptr<const TriangleMesh> edited;       // waiting; null if nothing is
  bool same_topology = false;                       // of `edited` and `blas`
  std::shared_ptr<SpareTree> spare;                 // null until the mesh is deformed
  std::shared_ptr<SparePositions> spare_positions;  // likewise
  UpdateHistory history;                            // of `blas`'s tree
};

// A mesh that was edited, or rests in a degraded tree, and how many rays it may expect.
struct ChangedMesh {
  std::int32_t mesh_id;
  const MeshState* state;
  std::optional<double> rays;
};

struct BlasResult {
  std::shared_ptr<const Blas> blas;  // null: the mesh keeps what it has
  UpdateHistory history;
  MeshReport report;
};

// The mesh did not move since the last commit.
[[nodiscard]] inline bool is_resting(const MeshState& state) noexcept { return state.edited == nullptr; }

}  // namespace perfect_bvh
