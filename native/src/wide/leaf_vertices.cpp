#include "wide/leaf_vertices.h"

#include <cstddef>

namespace perfect_bvh {
namespace {

constexpr std::size_t kGrain = 4096, kAhead = 16;  // leaves
constexpr std::uint32_t kNone = ~0u;

void list_vertices(const LeafBlock& leaf, const TriangleIndices* triangles, VertexNumbers& numbers) noexcept {
  numbers.at.fill(kNone);
  for (std::uint32_t i = 0; i < 8; ++i) {
    const TriangleIndices corners = triangles[leaf.primitives[i]];
    const std::uint32_t places = leaf.corners[i];
    numbers.at[places & 7u] = corners.x;
    numbers.at[(places >> 4) & 7u] = corners.y;
    numbers.at[(places >> 8) & 7u] = corners.z;
  }
  // Places to spare repeat the last vertex.
  for (std::uint32_t i = 1; i < 8; ++i) numbers.at[i] = numbers.at[i] == kNone ? numbers.at[i - 1] : numbers.at[i];
}

}  // namespace

LeafVertices list_leaf_vertices(const WideBvh& tree, const TriangleMesh& mesh, ThreadPool& pool, CancelToken& cancel) {
  LeafVertices vertices(tree.blocks.size());
  const TriangleIndices* const triangles = mesh.triangles.data();
  parallel_for(pool, tree.blocks.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    cancel.checkpoint();
    for (std::size_t row = begin; row < end; ++row) {
      if (row + kAhead < end) {
        for (const std::uint32_t primitive : tree.blocks[row + kAhead].primitives) {
          __builtin_prefetch(&triangles[primitive]);
        }
      }
      list_vertices(tree.blocks[row], triangles, vertices[row]);
    }
  });
  return vertices;
}

}  // namespace perfect_bvh
