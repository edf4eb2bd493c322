// Every builder of binary trees, each explained at the top of the file of its name (median.cpp, ...).
// In: references, not empty; settings that build_bvh2() has checked. Out: a tree, the same bytes for any number of
// threads.
#pragma once

#include <span>

#include "builders/build_config.h"
#include "builders/bvh2.h"
#include "builders/primitives.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

[[nodiscard]] Bvh2 build_median(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                                CancelToken& cancel);

[[nodiscard]] Bvh2 build_sweep(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                               CancelToken& cancel);

// With a limit, costs and leaf size are not asked: whatever fits is a leaf, and nothing else.
[[nodiscard]] Bvh2 build_binned(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                                CancelToken& cancel, const LeafLimit* leaf_limit = nullptr);

[[nodiscard]] Bvh2 build_fast(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                              CancelToken& cancel);

// Without a clipper primitives are taken to fill their boxes.
[[nodiscard]] Bvh2 build_spatial(std::span<const PrimRef> prims, const BuildConfig& config, const PrimClipper* clipper,
                                 ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
