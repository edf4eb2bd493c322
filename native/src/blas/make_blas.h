// From a mesh's state to the tree that its next snapshot is traced through: built, refitted or kept.
// In: the state, which stays as it is; what the commit knows. Out: the tree and its history, with a row of the report.
#pragma once

#include "blas/mesh_state.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// Whether a commit has anything to decide: the mesh was edited, or rests in a tree that its motion degraded.
[[nodiscard]] bool needs_decision(const MeshState& state, const CommitOptions& options) noexcept;

// Of a mesh that needs a decision. Throws Cancelled, bad_alloc.
[[nodiscard]] BlasResult make_blas(const ChangedMesh& changed, const CommitOptions& options, ThreadPool& pool,
                                   CancelToken& cancel);

// The steps of make_blas() ------------------------------------------------------------------------------------------

// rest_blas.cpp: whether a resting mesh keeps its tree; all of the result is then filled in.
[[nodiscard]] bool keeps_at_rest(const ChangedMesh& resting, const CommitOptions& options, BlasResult& result);

// refit_blas.cpp: makes the tree of `blas` from that over the same triangles where they were before. False if it cannot
// be refitted, or the governor wants another one.
[[nodiscard]] bool refit_blas(Blas& blas, const ChangedMesh& changed, const CommitOptions& options, BlasResult& result,
                              ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
