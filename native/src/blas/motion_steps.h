// The trees of a mesh that moves within the shutter: that of its first step, refitted to each of the others. All have
// the same nodes and leaves, one scale and one extent, so that a kernel can be between two of them.
#pragma once

#include "blas/blas.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// `blas` has the tree of the first step; does nothing if its mesh does not move. Throws Cancelled, bad_alloc.
void add_motion_steps(Blas& blas, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
