// What a ray is expected to visit in the tree that it is traced through (SAH: areas over the root's area).
#pragma once

#include "mesh/triangle_mesh.h"
#include "update/governor.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// One pass over the nodes. Zero where the box of the whole has no area, and for an empty tree.
[[nodiscard]] TraceWork measure_trace_work(const WideBvh& tree, const TriangleMesh& mesh) noexcept;

}  // namespace perfect_bvh
