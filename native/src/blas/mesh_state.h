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

}  // namespace perfect_bvh
