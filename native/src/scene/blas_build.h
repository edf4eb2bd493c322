// From a mesh to its tree.
#pragma once

#include "builders/build_config.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "scene/instance.h"
#include "scene/usage.h"

namespace perfect_bvh {

// Names the builder where the choice was left to the engine: a tree that lasts for a frame must be built in a blink,
// any other repays a better one.
[[nodiscard]] BuildConfig choose_builder(BuildConfig config, Usage usage) noexcept;

// Whether a tree that nobody will refit may be built straight into the wide one: the fast builder's, unless something
// was asked for that only a binary tree can heed.
[[nodiscard]] bool is_built_wide(const BuildConfig& config) noexcept;

[[nodiscard]] Bvh2 build_tree(const TriangleMesh& mesh, const BuildConfig& config, ThreadPool& pool,
                              CancelToken& cancel);

}  // namespace perfect_bvh
