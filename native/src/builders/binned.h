// Binned SAH construction (Wald 2007, "On fast construction of SAH-based bounding volume hierarchies"; lecture, "Rapid
// construction": planes independent of N).
// In: references, settings (bins, axes, costs). Out: a refittable tree with leaves where no split pays, or where
// primitives fit into one leaf of the wide tree.
#pragma once

#include <span>

#include "builders/build_config.h"
#include "builders/bvh2.h"
#include "builders/leaf_limit.h"
#include "builders/prim_ref.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// `prims` is not empty; `config` has been checked. With a limit, costs and leaf size are not asked: whatever fits is a
// leaf, and nothing else.
[[nodiscard]] Bvh2 build_binned(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                                CancelToken& cancel, const LeafLimit* leaf_limit = nullptr);

}  // namespace perfect_bvh
