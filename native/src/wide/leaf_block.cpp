#include "wide/leaf_block.h"

#include <algorithm>
#include <utility>

namespace perfect_bvh {
namespace {

std::uint32_t place_of(const LeafSet& set, std::uint32_t vertex) {
  std::uint32_t place = 0;
  while (set.vertices[place] != vertex) ++place;
  return place;
}

}  // namespace

LeafBlock make_leaf_block(const LeafSet& set, const TriangleMesh& mesh, float scale) {
  LeafBlock block;
  for (std::uint32_t i = 0; i < 8; ++i) {
    const Vec3f position = mesh.positions[set.vertices[std::min(i, set.vertex_count - 1)]];
    for (int axis = 0; axis < 3; ++axis) block.vertices[axis][i] = position[axis] * scale;
  }
  // By ascending number: then the first of several equal hits in a block is the one that wins ties.
  std::array<std::uint32_t, 8> primitives = set.primitives;
  for (std::uint32_t i = 1; i < set.primitive_count; ++i) {
    for (std::uint32_t k = i; k > 0 && primitives[k - 1] > primitives[k]; --k)
      std::swap(primitives[k - 1], primitives[k]);
  }
  for (std::uint32_t i = 0; i < 8; ++i) {
    const std::uint32_t primitive = primitives[std::min(i, set.primitive_count - 1)];
    const TriangleIndices corners = mesh.triangles[primitive];
    block.primitives[i] = primitive;
    block.corners[i] = place_of(set, corners.x) | place_of(set, corners.y) << 4 | place_of(set, corners.z) << 8;
  }
  return block;
}

}  // namespace perfect_bvh
