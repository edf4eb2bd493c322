#include "wide/leaf_refit.h"

#include <algorithm>

#include "wide/curve_leaf.h"
#include "wide/leaf_block.h"

namespace perfect_bvh {
namespace {

void fetch(const void* place) noexcept { __builtin_prefetch(place); }
void fetch_to_write(const void* place) noexcept { __builtin_prefetch(place, 1); }

// Leaves of triangles -----------------------------------------------------------------------------------------------

// What a leaf reads is asked for so many leaves ahead of time that it is in the cache when its turn comes: its numbers,
// which are at hand where leaves stand in order, then what these refer to.
constexpr std::size_t kNumbersAhead = 24, kVerticesAhead = 8;

void fetch_vertices(const VertexNumbers& numbers, const Vec3f* positions, const LeafBlock& block) noexcept {
  for (const std::uint32_t number : numbers.at) fetch(&positions[number]);
  fetch_to_write(&block.vertices[0][0]);
  fetch_to_write(&block.vertices[2][7]);
  fetch_to_write(&block.corners[0]);  // which, of every other block, begin a third line of the cache
}

// Positions are read as registers of four: what follows a vertex stands in a lane that means nothing.
Box4 write_vertices(const VertexNumbers& numbers, const Vec3f* positions, Float4 scale, LeafBlock& block) noexcept {
  Box4 box = Box4::empty();
  for (std::uint32_t first = 0; first < 8; first += 4) {
    Float4 vertices[4];
    for (std::uint32_t i = 0; i < 4; ++i) {
      vertices[i] = Float4::load_unaligned(&positions[numbers.at[first + i]]) * scale;
      box.grow(vertices[i]);
    }
    transpose(vertices[0], vertices[1], vertices[2], vertices[3]);
    for (std::uint32_t axis = 0; axis < 3; ++axis) vertices[axis].store(&block.vertices[axis][first]);
  }
  const Float4 zero(0.0f);  // -0 + 0 is 0
  return {box.lower + zero, box.upper + zero};
}

void refit_blocks(const WideBvh& from, const LeafVertices& vertices, const Mesh& mesh,
                  std::span<const std::uint32_t> rows, WideBvh& to, Box4* boxes) noexcept {
  const Vec3f* const positions = mesh.positions.data();
  const Float4 scale(to.scale);
  const bool is_copy = &from != &to;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i + kNumbersAhead < rows.size()) fetch(&vertices[rows[i + kNumbersAhead]]);
    if (i + kVerticesAhead < rows.size()) {
      const std::uint32_t row = rows[i + kVerticesAhead];
      fetch_vertices(vertices[row], positions, to.blocks[row]);
    }
    LeafBlock& block = to.blocks[rows[i]];
    if (is_copy) {
      std::copy_n(from.blocks[rows[i]].corners, 8, block.corners);
      std::copy_n(from.blocks[rows[i]].primitives, 8, block.primitives);
    }
    boxes[i] = write_vertices(vertices[rows[i]], positions, scale, block);
    write_span(block, boxes[i]);
  }
}

// Leaves of curves and points --------------------------------------------------------------------------------------

// Of curves and points, eight of them.
Box4 round_box_of(const std::uint32_t* primitives, const Mesh& mesh, Float4 scale) noexcept {
  Box4 box = Box4::empty();
  for (std::size_t lane = 0; lane < 8; ++lane) {
    const Aabb one = mesh.primitive_box(primitives[lane]);
    box.grow({load_xyz(&one.lower), load_xyz(&one.upper)});
  }
  const Float4 zero(0.0f);
  return {box.lower * scale + zero, box.upper * scale + zero};
}

// From a leaf to its balls there are two steps through memory for points, three for curves, each of which knows where
// the next one goes. `move(row)` writes the leaf.
constexpr std::size_t kLeafAhead = 24, kSegmentsAhead = 16, kBallsAhead = 8;

template <class Leaf, class Move>
void refit_round_leaves(const AlignedVector<Leaf>& leaves, const Mesh& mesh, std::span<const std::uint32_t> rows,
                        float scale, Box4* boxes, const Move& move) noexcept {
  const bool is_curves = mesh.kind == PrimitiveKind::kCurves;
  const auto numbers_at = [&](std::size_t i) { return std::span(leaves[rows[i]].primitives); };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i + kLeafAhead < rows.size()) fetch(numbers_at(i + kLeafAhead).data());
    if (is_curves && i + kSegmentsAhead < rows.size()) {
      for (const std::uint32_t primitive : numbers_at(i + kSegmentsAhead)) fetch(&mesh.segments[primitive]);
    }
    if (i + kBallsAhead < rows.size()) {
      for (const std::uint32_t primitive : numbers_at(i + kBallsAhead)) {
        fetch(&mesh.balls[is_curves ? mesh.segments[primitive] & kSegmentBall : primitive]);
      }
    }
    boxes[i] = round_box_of(numbers_at(i).data(), mesh, Float4(scale));
    move(rows[i]);
  }
}

void refit_round_leaves(const WideBvh& from, const Mesh& mesh, std::span<const std::uint32_t> rows, WideBvh& to,
                        Box4* boxes) noexcept {
  const bool is_copy = &from != &to;
  if (!from.curve_leaves.empty()) {
    refit_round_leaves(from.curve_leaves, mesh, rows, to.scale, boxes, [&](std::uint32_t row) {
      if (is_copy) to.curve_leaves[row] = from.curve_leaves[row];
      write_axes(to.curve_leaves[row], mesh, to.scale);
    });
  } else {
    refit_round_leaves(from.point_leaves, mesh, rows, to.scale, boxes, [&](std::uint32_t row) {
      if (is_copy) to.point_leaves[row] = from.point_leaves[row];
    });
  }
}

}  // namespace

void refit_leaves(const WideBvh& from, const LeafVertices& vertices, const Mesh& mesh,
                  std::span<const std::uint32_t> rows, WideBvh& to, Box4* boxes) noexcept {
  if (mesh.is_round()) {
    refit_round_leaves(from, mesh, rows, to, boxes);
  } else {
    refit_blocks(from, vertices, mesh, rows, to, boxes);
  }
}

}  // namespace perfect_bvh
