// The leaves of a wide tree.
#pragma once

#include <cstdint>

#include "mesh/triangle_mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// From 1 to 8 different triangles over at most 8 vertices, in any order. Positions are taken times `scale`.
[[nodiscard]] LeafBlock make_leaf_block(const std::uint32_t* primitives, std::uint32_t count, const TriangleMesh& mesh,
                                        float scale) noexcept;

// The same triangles as a leaf of the compact layout: 1 to 8, over any number of vertices.
[[nodiscard]] IndexedLeaf make_indexed_leaf(const std::uint32_t* primitives, std::uint32_t count) noexcept;

}  // namespace perfect_bvh
