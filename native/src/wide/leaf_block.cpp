#include "wide/leaf_block.h"

#include <algorithm>
#include <array>

#include "wide/small_set.h"

namespace perfect_bvh {

LeafBlock make_leaf_block(const std::uint32_t* primitives, std::uint32_t count, const TriangleMesh& mesh,
                          float scale) noexcept {
  LeafBlock block;
  // By ascending number: then the first of several equal hits in a block is the one that wins ties.
  for (std::uint32_t i = 0; i < count; ++i) {
    std::uint32_t place = i;
    for (; place > 0 && block.primitives[place - 1] > primitives[i]; --place) {
      block.primitives[place] = block.primitives[place - 1];
    }
    block.primitives[place] = primitives[i];
  }
  SmallSet vertices;
  for (std::uint32_t i = 0; i < count; ++i) {
    const TriangleIndices corners = mesh.triangles[block.primitives[i]];
    const std::uint32_t x = vertices.add(corners.x), y = vertices.add(corners.y), z = vertices.add(corners.z);
    block.corners[i] = x | y << 4 | z << 8;
  }
  for (std::uint32_t i = count; i < 8; ++i) {
    block.primitives[i] = block.primitives[count - 1];
    block.corners[i] = block.corners[count - 1];
  }
  const std::array<std::uint32_t, 8> numbers = vertices.numbers();
  for (std::uint32_t i = 0; i < 8; ++i) {
    const Vec3f position = mesh.positions[numbers[i]];
    for (int axis = 0; axis < 3; ++axis) block.vertices[axis][i] = position[axis] * scale;
  }
  return block;
}

}  // namespace perfect_bvh
