// Which builder makes a mesh's tree where that is left to the engine: what the rays repay, as far as they are known.
//
// Rays that a caller expects decide alone. Where none are known, a mesh's usage does; the rays that were cast since the
// last commit then only ever lead to a better tree than that, as a few to try something out promise no end of rays. A
// tree that its mesh rests in is replaced once more rays than repay another have come or are to come. Each step leads
// to a better builder, so there are at most two for the same triangles.
#pragma once

#include <vector>

#include "blas/mesh_state.h"
#include "builders/build_config.h"
#include "core/cancel.h"
#include "update/governor.h"

namespace perfect_bvh {

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

}  // namespace perfect_bvh
