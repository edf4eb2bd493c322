// A wide tree straight from a mesh, without a binary tree in between that would be kept: for topology that changes
// every frame (lecture, "Rapid construction"). Leaves along a Morton curve, clustered in place, collapsed as they are:
// a third to a quarter of the time of any builder whose tree is collapsed afterwards.
// In: a mesh. Out: a WideBvh, the same bytes for any number of threads.
#pragma once

#include "builders/build_config.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Empty over no triangles. Throws Cancelled, EngineError, bad_alloc.
[[nodiscard]] WideBvh build_fast_wide(const Mesh& mesh, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
