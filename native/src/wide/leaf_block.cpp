#include "wide/leaf_block.h"

#include <algorithm>
#include <array>
#include <bit>

#include "math/sorting_network.h"
#include "wide/small_set.h"

namespace perfect_bvh {
namespace {

void order(std::uint32_t& a, std::uint32_t& b) noexcept {
  const std::uint32_t smaller = std::min(a, b);
  b = std::max(a, b);
  a = smaller;
}

}  // namespace

void write_sorted(const std::uint32_t* numbers, std::uint32_t count, std::uint32_t* sorted) noexcept {
  std::array<std::uint32_t, 8> v;
  v.fill(~0u);
  for (std::uint32_t i = 0; i < count; ++i) v[i] = numbers[i];
  sort_eight(v, order);
  for (std::uint32_t i = 0; i < 8; ++i) sorted[i] = v[std::min(i, count - 1)];
}

void write_span(LeafBlock& block, const Box4& box) noexcept {
  constexpr std::uint32_t kCornerBits = 0xFFF, kRoundedUp = 2 * (kCornerBits + 1), kPoint = 0xFF800000;
  alignas(16) float extent[4];
  (box.upper - box.lower).store(extent);
  const float span = (extent[0] + extent[1]) + extent[2];
  const std::uint32_t bits = (std::bit_cast<std::uint32_t>(span) & ~kCornerBits) + kRoundedUp;
  block.corners[0] = (block.corners[0] & kCornerBits) | (span > 0.0f ? bits : kPoint);
}

Box4 write_vertices(LeafBlock& block, const std::uint32_t* vertices, const Mesh& mesh, float scale) noexcept {
  std::array<Float4, 8> rows;
  for (std::size_t i = 0; i < 8; ++i) rows[i] = load_position(&mesh.positions[vertices[i]]).xyz0() * Float4(scale);
  Box4 box{rows[0], rows[0]};
  for (std::size_t i = 1; i < 8; ++i) box.grow(rows[i]);
  transpose(rows[0], rows[1], rows[2], rows[3]);
  transpose(rows[4], rows[5], rows[6], rows[7]);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    rows[axis].store(&block.vertices[axis][0]);
    rows[axis + 4].store(&block.vertices[axis][4]);
  }
  write_span(block, box);
  return box;
}

LeafBlock make_leaf_block(const std::uint32_t* primitives, std::uint32_t count, const Mesh& mesh,
                          float scale) noexcept {
  LeafBlock block;
  write_sorted(primitives, count, block.primitives);
  const TriangleIndices* const triangles = mesh.triangles.data();
  SmallSet vertices;
  std::array<std::uint32_t, 8> words;
  for (std::uint32_t i = 0; i < count; ++i) {
    const TriangleIndices corners = triangles[block.primitives[i]];
    const auto [x, y, z] = vertices.add(corners.x, corners.y, corners.z);
    words[i] = x | y << 4 | z << 8;
  }
  // To the end, whatever the count: a loop of unforeseeable length costs as much as all that is in it.
  for (std::uint32_t i = 0; i < 8; ++i) block.corners[i] = words[std::min(i, count - 1)];
  static_cast<void>(write_vertices(block, vertices.numbers().data(), mesh, scale));
  return block;
}

PointLeaf make_point_leaf(const std::uint32_t* primitives, std::uint32_t count) noexcept {
  PointLeaf leaf;
  write_sorted(primitives, count, leaf.primitives);
  return leaf;
}

}  // namespace perfect_bvh
