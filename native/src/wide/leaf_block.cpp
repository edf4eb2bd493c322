#include "wide/leaf_block.h"

#include <algorithm>
#include <array>
#include <bit>
#include <type_traits>

#include "math/float4.h"
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

LeafBlock make_leaf(TriangleTraits, const std::uint32_t* primitives, std::uint32_t count, const Mesh& mesh,
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
  // Always 8 iterations: a loop of unpredictable length would cost as much as its whole body.
  for (std::uint32_t i = 0; i < 8; ++i) block.corners[i] = words[std::min(i, count - 1)];
  static_cast<void>(write_vertices(block, vertices.numbers().data(), mesh, scale));
  return block;
}

// Curve leaf ----------------------------------------------------------------------------------------------------------
// Leaves over curves: the capsule of each segment in whole steps, eight side by side. Precision, in steps: a coordinate
// is subtracted, multiplied and rounded to a whole number. With u = 2^-24 that moves it by less than .5 + 3 * 1024 u <
// .5002 on each axis, so a centre by less than .8664. A radius grows by more: by .8671, by the products' rounding
// errors, and to the next whole number.
// roundings, and to the next whole number.

namespace {

constexpr float kMostSteps = 1023.0f;   // in ten bits
constexpr float kMostRadius = 250.0f;   // in eight bits, with all growth
constexpr float kMostInUnit = 0x1p48f;  // so that no product of steps leaves the range of float

// The spheres at one end of eight segments, as rows: x, y, z, radii of the first four, then of the others.
using BallRows = std::array<Float4, 8>;

[[nodiscard]] BallRows to_rows(std::array<Float4, 8> balls) noexcept {
  transpose(balls[0], balls[1], balls[2], balls[3]);
  transpose(balls[4], balls[5], balls[6], balls[7]);
  return balls;
}

[[nodiscard]] float steps_for(float extent, float radius) noexcept {
  const float of_axes = extent > 0.0f ? kMostSteps / extent : kMostInUnit;
  const float of_radii = radius > 0.0f ? kMostRadius / radius : kMostInUnit;
  return std::min({of_axes, of_radii, kMostInUnit});
}

// Writes the words of four centres.
void write_words(const Float4* rows, const CurveLeaf& leaf, std::uint32_t* words) noexcept {
  const Float4 steps(leaf.corner.steps), half(0.5f);
  const auto rounded = [&](int axis) { return truncate((rows[axis] - Float4(leaf.corner.at[axis])) * steps + half); };
  (rounded(0) | rounded(1) << 10 | rounded(2) << 20).store(words);
}

// Updates a leaf to the present positions of its primitives.
void move_leaf(PointLeaf& /*leaf*/, const Mesh& /*mesh*/, float /*scale*/) noexcept {}
void move_leaf(CurveLeaf& leaf, const Mesh& mesh, float scale) noexcept {
  std::array<Float4, 8> first, last;
  Box4 box = Box4::empty();  // of the centres; the fourth: of the radii
  for (std::size_t lane = 0; lane < 8; ++lane) {
    const Ball* const ball = &CurveTraits::first(mesh, leaf.primitives[lane]);
    first[lane] = Float4::load(ball) * Float4(scale), last[lane] = Float4::load(ball + 1) * Float4(scale);
    box.grow(first[lane]), box.grow(last[lane]);
  }
  alignas(16) std::array<float, 4> lower, upper, extent;
  box.lower.store(&lower[0]), box.upper.store(&upper[0]), (box.upper - box.lower).store(&extent[0]);
  for (std::size_t axis = 0; axis < 3; ++axis) leaf.corner.at[axis] = lower[axis] + 0.0f;  // no -0
  leaf.corner.steps = steps_for(std::max({extent[0], extent[1], extent[2]}), upper[3]);
  // While a tree is refitted, coordinates may leave the range of its scale. It is then refitted again in another scale.
  if (!(leaf.corner.steps * (extent[0] + extent[1] + extent[2] + upper[3]) < 1e6f)) return;
  const BallRows firsts = to_rows(first), lasts = to_rows(last);
  for (std::size_t half = 0; half < 8; half += 4) {
    write_words(&firsts[half], leaf, &leaf.first[half]);
    write_words(&lasts[half], leaf, &leaf.last[half]);
    constexpr float kRoundedUp = 1.0f + 0x1p-20f, kMoved = 1.8671f;
    const Float4 radius =
        max(firsts[half + 3], lasts[half + 3]) * Float4(leaf.corner.steps * kRoundedUp) + Float4(kMoved);
    alignas(16) std::array<std::int32_t, 4> radii;
    truncate(radius).store(&radii[0]);
    for (std::size_t i = 0; i < 4; ++i) leaf.radii[half + i] = static_cast<std::uint8_t>(radii[i]);
  }
}

}  // namespace

CurveLeaf make_leaf(CurveTraits, const std::uint32_t* primitives, std::uint32_t count, const Mesh& mesh,
                    float scale) noexcept {
  CurveLeaf leaf{};
  write_sorted(primitives, count, leaf.primitives);
  leaf.lanes = (1u << count) - 1;
  move_leaf(leaf, mesh, scale);
  return leaf;
}

// Leaf refit ----------------------------------------------------------------------------------------------------------

namespace {

void fetch(const void* place) noexcept { __builtin_prefetch(place); }
void fetch_to_write(const void* place) noexcept { __builtin_prefetch(place, 1); }

// Leaves of triangles -----------------------------------------------------------------------------------------------

// Data that a leaf reads is prefetched this many leaves ahead, so that it is in the cache in time: first its numbers,
// which are close together if leaves are in order, then the vertices that they refer to.
constexpr std::size_t kNumbersAhead = 24, kVerticesAhead = 8;

void fetch_vertices(const VertexNumbers& numbers, const Vec3f* positions, const LeafBlock& block) noexcept {
  for (const std::uint32_t number : numbers.at) fetch(&positions[number]);
  fetch_to_write(&block.vertices[0][0]);
  fetch_to_write(&block.vertices[2][7]);
  fetch_to_write(&block.corners[0]);  // in every other block, these begin a third cache line
}

// Positions are read as registers of four: the bytes after a vertex land in a lane that is ignored.
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

void refit(TriangleTraits, const WideBvh& from, const LeafVertices& vertices, const Mesh& mesh,
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

// Returns the box of eight of them.
template <class Kind>
Box4 round_box_of(const std::uint32_t* primitives, const Mesh& mesh, Float4 scale) noexcept {
  Box4 box = Box4::empty();
  for (std::size_t lane = 0; lane < 8; ++lane) {
    const Aabb one = Kind::box(mesh, primitives[lane]);
    box.grow({load_xyz(&one.lower), load_xyz(&one.upper)});
  }
  const Float4 zero(0.0f);
  return {box.lower * scale + zero, box.upper * scale + zero};
}

// From a leaf to its spheres there are two memory reads for points and three for curves. Each read gives the address of
// the next.
constexpr std::size_t kLeafAhead = 24, kSegmentsAhead = 16, kBallsAhead = 8;

template <class Kind>
void refit(Kind kind, const WideBvh& from, const LeafVertices& /*vertices*/, const Mesh& mesh,
           std::span<const std::uint32_t> rows, WideBvh& to, Box4* boxes) noexcept {
  const auto* const leaves = leaves_of(kind, from).data();
  auto* const moved = leaves_of(kind, to).data();
  const bool is_copy = &from != &to;
  const Float4 scale(to.scale);
  const auto numbers_at = [&](std::size_t i) { return std::span(leaves[rows[i]].primitives); };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i + kLeafAhead < rows.size()) fetch(numbers_at(i + kLeafAhead).data());
    if (std::is_same_v<Kind, CurveTraits> && i + kSegmentsAhead < rows.size()) {
      for (const std::uint32_t primitive : numbers_at(i + kSegmentsAhead)) fetch(&mesh.segments[primitive]);
    }
    if (i + kBallsAhead < rows.size()) {
      for (const std::uint32_t primitive : numbers_at(i + kBallsAhead)) fetch(&Kind::first(mesh, primitive));
    }
    boxes[i] = round_box_of<Kind>(numbers_at(i).data(), mesh, scale);
    if (is_copy) moved[rows[i]] = leaves[rows[i]];
    move_leaf(moved[rows[i]], mesh, to.scale);
  }
}

}  // namespace

void refit_leaves(const WideBvh& from, const LeafVertices& vertices, const Mesh& mesh,
                  std::span<const std::uint32_t> rows, WideBvh& to, Box4* boxes) noexcept {
  with_kind(mesh.kind, [&](auto kind) { refit(kind, from, vertices, mesh, rows, to, boxes); });
}

}  // namespace perfect_bvh
