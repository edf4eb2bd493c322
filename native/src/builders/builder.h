// Builds a tree over boxes with the configured builder.
// In: one PrimRef a primitive (any numbering), a cancel token. Out: a Bvh2 with the same bytes for any thread count.
#pragma once

#include <span>
#include <string_view>

#include "builders/build_config.h"
#include "builders/bvh2.h"
#include "builders/primitives.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// The builder that users write so. Throws InvalidArgument if there is none.
[[nodiscard]] BuilderKind find_builder(std::string_view name);

// References with an empty or non-finite box must not be passed. Counts prims.size() units of work on `cancel`. Throws
// InvalidArgument for settings out of range (naming them), Cancelled, bad_alloc. Spatial splits ask the clipper;
// without one they take primitives to fill their boxes. With config.fills_leaves, leaves are as large as the limit
// allows; without one the setting is ignored.
[[nodiscard]] Bvh2 build_bvh2(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                              CancelToken& cancel, const PrimClipper* clipper = nullptr,
                              const LeafLimit* leaf_limit = nullptr);

}  // namespace perfect_bvh
