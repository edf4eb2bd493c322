// The leaves of a wide tree.
#pragma once

#include "mesh/triangle_mesh.h"
#include "wide/collapse_plan.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Positions are taken times `scale`.
[[nodiscard]] LeafBlock make_leaf_block(const LeafSet& set, const TriangleMesh& mesh, float scale);

}  // namespace perfect_bvh
