// Construction for topology that changes every frame (lecture, "Rapid construction"): binned SAH over clusters of a few
// neighbours along a Morton curve (Garanzha et al. 2011), then the best splits inside them. A fifth of the references to
// bin, at nearly the same cost of the tree.
// In: references, settings (bins, axes, costs). Out: a refittable tree with leaves where no split pays.
#pragma once

#include <span>

#include "builders/build_config.h"
#include "builders/bvh2.h"
#include "builders/prim_ref.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// `prims` is not empty; `config` has been checked.
[[nodiscard]] Bvh2 build_fast(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                              CancelToken& cancel);

}  // namespace perfect_bvh
