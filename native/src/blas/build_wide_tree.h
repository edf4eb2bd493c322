// From a mesh to the tree that rays are traced through, by the builder of its settings: a binary tree is built and
// collapsed, or the wide one is built at once.
#pragma once

#include "blas/blas.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "stats/commit_report.h"

namespace perfect_bvh {

// Fills in the tree of `blas`, its quality and its box. In: the mesh and `config`, its builder named; optimisation is
// noted there as it was done. Out: how long the steps took, in the report. Throws Cancelled, bad_alloc.
void build_wide_tree(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
