// How good a wide tree over triangles is, and whether it is sound.
#pragma once

#include <string>

#include "builders/quality.h"
#include "mesh/triangle_mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// For trees that were never binary ones: visits are those of wide nodes, so they are fewer than a binary tree's. Leaves
// are leaf blocks; sibling overlap is that of every two children of a node, as a share of the nodes' area.
[[nodiscard]] TreeQuality measure_wide_quality(const WideBvh& tree, const TriangleMesh& mesh);

// Empty if the tree is sound: every triangle in some leaf (in one alone if `once`), every vertex where the mesh has it,
// boxes inside their parents' and around what they hold, no node or leaf reached twice or not at all, every order a
// permutation, depth as stored. Otherwise a sentence that names the first fault.
[[nodiscard]] std::string find_wide_fault(const WideBvh& tree, const TriangleMesh& mesh, bool once);

}  // namespace perfect_bvh
