// The trees of a mesh that moves within the shutter: one, refitted to each of its steps. All have the same nodes and
// leaves, one scale and one extent, so that a kernel can be between two of them. They are those of the tree that is
// best half-way: by the ends of an explosion, what was together at its beginning is not.
#pragma once

#include "blas/blas.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "stats/commit_report.h"

namespace perfect_bvh {

// build_wide_tree() of a mesh that moves: built over where its primitives are half-way, refitted to the first step.
void build_moving_tree(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel);

// `blas` has the tree of the first step; does nothing if its mesh does not move. Throws Cancelled, bad_alloc.
void add_motion_steps(Blas& blas, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
