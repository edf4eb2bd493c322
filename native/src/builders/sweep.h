// Full SAH construction: all 3(N-1) planes of every node (MacDonald and Booth 1990; lecture, "Candidates"), over
// references that are sorted once and stay sorted while they are divided (Wald 2007, "sweep").
// In: references, costs. Out: a refittable tree, the lowest cost that greedy object splits reach.
#pragma once

#include <span>

#include "builders/build_config.h"
#include "builders/bvh2.h"
#include "builders/prim_ref.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// `prims` is not empty; `config` has been checked.
[[nodiscard]] Bvh2 build_sweep(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                               CancelToken& cancel);

}  // namespace perfect_bvh
