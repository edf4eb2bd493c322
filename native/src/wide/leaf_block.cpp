#include "wide/leaf_block.h"

#include <algorithm>
#include <array>

#include "math/sorting_network.h"
#include "wide/small_set.h"

namespace perfect_bvh {
namespace {

void order(std::uint32_t& a, std::uint32_t& b) noexcept {
  const std::uint32_t smaller = std::min(a, b);
  b = std::max(a, b);
  a = smaller;
}

// By ascending number: then the first of several equal hits in a leaf is the one that wins ties. The places past count
// repeat the last number.
void write_sorted(const std::uint32_t* numbers, std::uint32_t count, std::uint32_t* sorted) noexcept {
  std::array<std::uint32_t, 8> v;
  for (std::uint32_t i = 0; i < 8; ++i) v[i] = i < count ? numbers[i] : ~0u;
  sort_eight(v, order);
  std::copy(v.begin(), v.end(), sorted);
  std::fill(sorted + count, sorted + 8, sorted[count - 1]);
}

}  // namespace

LeafBlock make_leaf_block(const std::uint32_t* primitives, std::uint32_t count, const TriangleMesh& mesh,
                          float scale) noexcept {
  LeafBlock block;
  write_sorted(primitives, count, block.primitives);
  SmallSet vertices;
  for (std::uint32_t i = 0; i < count; ++i) {
    const TriangleIndices corners = mesh.triangles[block.primitives[i]];
    const auto [x, y, z] = vertices.add(corners.x, corners.y, corners.z);
    block.corners[i] = x | y << 4 | z << 8;
  }
  std::fill(block.corners + count, block.corners + 8, block.corners[count - 1]);
  const std::array<std::uint32_t, 8> numbers = vertices.numbers();
  for (std::uint32_t i = 0; i < 8; ++i) {
    const Vec3f position = mesh.positions[numbers[i]];
    for (int axis = 0; axis < 3; ++axis) block.vertices[axis][i] = position[axis] * scale;
  }
  return block;
}

IndexedLeaf make_indexed_leaf(const std::uint32_t* primitives, std::uint32_t count) noexcept {
  IndexedLeaf leaf;
  write_sorted(primitives, count, leaf.primitives);
  return leaf;
}

}  // namespace perfect_bvh
