// From a mesh to its tree.
#pragma once

#include "build/build_config.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "scene/instance.h"

namespace perfect_bvh {

[[nodiscard]] Bvh2 build_tree(const TriangleMesh& mesh, const BuildConfig& config, ThreadPool& pool,
                              CancelToken& cancel);

}  // namespace perfect_bvh
