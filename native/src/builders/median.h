// The naive reference: halves of equal size, divided at the median centroid on the axis where the centroids spread
// most (lecture, "Naive against SAH"). No cost is looked at; leaves have a fixed size.
// In: references. Out: a refittable tree of the least depth.
#pragma once

#include <span>

#include "builders/build_config.h"
#include "builders/bvh2.h"
#include "builders/prim_ref.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// `prims` is not empty; `config` has been checked.
[[nodiscard]] Bvh2 build_median(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                                CancelToken& cancel);

}  // namespace perfect_bvh
