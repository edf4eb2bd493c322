#include "wide/leaf_refit.h"

#include <algorithm>
#include <array>

namespace perfect_bvh {
namespace {

using VertexNumbers = std::array<std::uint32_t, 8>;

// From a leaf to its vertices are three steps through memory, each of which knows where the next one goes. They are
// taken so many leaves ahead of time that each finds in the cache what it needs.
constexpr std::size_t kBlocksAhead = 24, kTrianglesAhead = 16, kVerticesAhead = 8;

void fetch(const void* place) noexcept { __builtin_prefetch(place); }
void fetch_to_write(const void* place) noexcept { __builtin_prefetch(place, 1); }

void fetch_block(const LeafBlock& shape, const LeafBlock& block) noexcept {
  fetch(&shape.corners[0]);
  fetch(&shape.primitives[7]);
  fetch_to_write(&block.vertices[0][0]);
  fetch_to_write(&block.vertices[2][0]);
  if (&block == &shape) return;
  fetch_to_write(&block.primitives[7]);
}

void fetch_triangles(const LeafBlock& shape, const TriangleIndices* triangles) noexcept {
  for (const std::uint32_t primitive : shape.primitives) fetch(&triangles[primitive]);
}

// The numbers of a leaf's vertices, place by place. Written where they are to stay: read back at once as a whole,
// single stores would stall.
void list_vertices(const LeafBlock& shape, const TriangleIndices* triangles, VertexNumbers& numbers) noexcept {
  numbers.fill(~0u);
  for (std::uint32_t i = 0; i < 8; ++i) {
    const TriangleIndices corners = triangles[shape.primitives[i]];
    const std::uint32_t places = shape.corners[i];
    numbers[places & 7u] = corners.x;
    numbers[(places >> 4) & 7u] = corners.y;
    numbers[(places >> 8) & 7u] = corners.z;
  }
  // Places to spare repeat the last vertex.
  for (std::uint32_t i = 1; i < 8; ++i) numbers[i] = numbers[i] == ~0u ? numbers[i - 1] : numbers[i];
}

Box4 write_block(const LeafBlock& shape, const VertexNumbers& numbers, const Vec3f* positions, Float4 scale,
                 LeafBlock& block) noexcept {
  if (&block != &shape) {
    std::copy_n(shape.corners, 8, block.corners);
    std::copy_n(shape.primitives, 8, block.primitives);
  }
  Box4 box = Box4::empty();
  for (std::uint32_t first = 0; first < 8; first += 4) {
    Float4 vertices[4];
    for (std::uint32_t i = 0; i < 4; ++i) {
      vertices[i] = load_xyz(&positions[numbers[first + i]]) * scale;
      box.grow(vertices[i]);
    }
    transpose(vertices[0], vertices[1], vertices[2], vertices[3]);
    for (std::uint32_t axis = 0; axis < 3; ++axis) vertices[axis].store(&block.vertices[axis][first]);
  }
  const Float4 zero(0.0f);  // -0 + 0 is 0
  return {box.lower + zero, box.upper + zero};
}

void refit_blocks(const WideBvh& from, const TriangleMesh& mesh, std::span<const std::uint32_t> rows, WideBvh& to,
                  Box4* boxes) noexcept {
  const TriangleIndices* const triangles = mesh.triangles.data();
  const Vec3f* const positions = mesh.positions.data();
  const Float4 scale(to.scale);
  std::array<VertexNumbers, kVerticesAhead> ring;
  // Leaf i is written in round i; what is fetched for it is fetched in earlier rounds, the first of them below zero.
  for (std::size_t round = 0; round < rows.size() + kBlocksAhead; ++round) {
    if (round < rows.size()) fetch_block(from.blocks[rows[round]], to.blocks[rows[round]]);
    const std::size_t indexed = round - (kBlocksAhead - kTrianglesAhead);  // huge before its turn
    if (indexed < rows.size()) fetch_triangles(from.blocks[rows[indexed]], triangles);
    const std::size_t gathered = round - (kBlocksAhead - kVerticesAhead);
    const std::size_t written = round - kBlocksAhead;
    if (written < rows.size()) {
      boxes[written] = write_block(from.blocks[rows[written]], ring[written % kVerticesAhead], positions, scale,
                                   to.blocks[rows[written]]);
    }
    if (gathered < rows.size()) {
      VertexNumbers& numbers = ring[gathered % kVerticesAhead];
      list_vertices(from.blocks[rows[gathered]], triangles, numbers);
      for (const std::uint32_t number : numbers) fetch(&positions[number]);
    }
  }
}

void fetch_vertices(const IndexedLeaf& leaf, const TriangleMesh& mesh) noexcept {
  for (const std::uint32_t primitive : leaf.primitives) {
    const TriangleIndices corners = mesh.triangles[primitive];
    fetch(&mesh.positions[corners.x]), fetch(&mesh.positions[corners.y]), fetch(&mesh.positions[corners.z]);
  }
}

Box4 box_of(const IndexedLeaf& leaf, const TriangleMesh& mesh, Float4 scale) noexcept {
  Box4 box = Box4::empty();
  for (const std::uint32_t primitive : leaf.primitives) {
    const TriangleIndices corners = mesh.triangles[primitive];
    for (const std::uint32_t vertex : {corners.x, corners.y, corners.z}) box.grow(load_xyz(&mesh.positions[vertex]));
  }
  const Float4 zero(0.0f);
  return {box.lower * scale + zero, box.upper * scale + zero};
}

// Leaves of the compact layout do not change: only their boxes do.
void refit_indexed_leaves(const WideBvh& from, const TriangleMesh& mesh, std::span<const std::uint32_t> rows,
                          WideBvh& to, Box4* boxes) noexcept {
  const Float4 scale(to.scale);
  const auto leaf_at = [&](std::size_t i) -> const IndexedLeaf& { return from.indexed_leaves[rows[i]]; };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i + kBlocksAhead < rows.size()) fetch(&leaf_at(i + kBlocksAhead));
    if (i + kTrianglesAhead < rows.size()) {
      for (const std::uint32_t primitive : leaf_at(i + kTrianglesAhead).primitives) fetch(&mesh.triangles[primitive]);
    }
    if (i + kVerticesAhead < rows.size()) fetch_vertices(leaf_at(i + kVerticesAhead), mesh);
    boxes[i] = box_of(leaf_at(i), mesh, scale);
    if (&from != &to) to.indexed_leaves[rows[i]] = leaf_at(i);
  }
}

}  // namespace

void refit_leaves(const WideBvh& from, const TriangleMesh& mesh, std::span<const std::uint32_t> rows, WideBvh& to,
                  Box4* boxes) noexcept {
  (from.layout == TreeLayout::kCompact ? refit_indexed_leaves : refit_blocks)(from, mesh, rows, to, boxes);
}

}  // namespace perfect_bvh
