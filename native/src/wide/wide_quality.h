// How good a wide tree over triangles is.
#pragma once

#include "builders/quality.h"
#include "mesh/mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// For trees that were never binary ones: visits are those of wide nodes, so they are fewer than a binary tree's. Leaves
// are leaf blocks; sibling overlap is that of every two children of a node, as a share of the nodes' area.
[[nodiscard]] TreeQuality measure_wide_quality(const WideBvh& tree, const Mesh& mesh);

}  // namespace perfect_bvh
