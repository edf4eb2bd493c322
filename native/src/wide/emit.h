// Writes the wide tree that was planned (collapse_plan.h), depth first.
#pragma once

#include <span>

#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/triangle_mesh.h"
#include "wide/collapse_plan.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Fills in nodes, leaves, root and depth; scale and layout must be set. Mesh: null for a top level. Threads share out
// subtrees: they first count what each will need, then write it where it belongs. Throws EngineError if the tree gets
// more nodes, leaves or instances than a child can refer to.
void emit_wide(const Bvh2& tree, const TriangleMesh* mesh, std::span<const CollapseDecision> decisions, WideBvh& wide,
               ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
