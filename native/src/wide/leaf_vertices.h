// Which vertices each leaf holds, place by place: what a refit reads instead of the leaf's triangles and theirs in the
// mesh, which halves the time of a leaf. 32 bytes a leaf, or 6 a triangle, of meshes that deform alone.
#pragma once

#include <array>
#include <cstdint>

#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/triangle_mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

struct alignas(32) VertexNumbers {
  std::array<std::uint32_t, 8> at;  // in the mesh, by place in LeafBlock::vertices
};

// By row of the leaf; empty for the compact layout, whose leaves hold no vertices. It holds for as long as the leaves
// are the same, whatever happens to the nodes above them.
using LeafVertices = AlignedVector<VertexNumbers>;

[[nodiscard]] LeafVertices list_leaf_vertices(const WideBvh& tree, const TriangleMesh& mesh, ThreadPool& pool,
                                              CancelToken& cancel);

}  // namespace perfect_bvh
