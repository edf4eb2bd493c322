// The leaves of a wide tree.
#pragma once

#include <cstdint>
#include <span>

#include "core/aligned.h"
#include "math/float4.h"
#include "mesh/mesh.h"
#include "wide/small_set.h"
#include "wide/wide_bvh.h"
#include "wide/wide_refit.h"

namespace perfect_bvh {

// The capacity of one leaf: the number of different primitives and, if the leaf stores vertices, at most 8 of those.
struct LeafRoom {
  std::uint32_t most = 1;                      // an instance, in a top level
  const TriangleIndices* triangles = nullptr;  // null: vertices do not count

  LeafRoom() noexcept = default;
  explicit LeafRoom(const Mesh& mesh) noexcept : most(SmallSet::kMost), triangles(mesh.triangles.data()) {}

  [[nodiscard]] bool holds(std::span<const std::uint32_t> numbers) const noexcept {
    if (numbers.size() > most) return false;
    if (numbers.size() <= 2 || triangles == nullptr) return true;  // two triangles have 6 corners
    SmallSet vertices;
    for (const std::uint32_t number : numbers) {
      const TriangleIndices corners = triangles[number];
      vertices.add(corners.x, corners.y, corners.z);
    }
    return !vertices.overflows();
  }
};

// Resizes the tree's leaves of the mesh's kind to `count`, and clears the others.
inline void make_room_for_leaves(const Mesh& mesh, std::size_t count, WideBvh& tree) {
  for_each_kind([&](auto kind) { leaves_of(kind, tree).clear(); });
  with_kind(mesh.kind, [&](auto kind) { leaves_of(kind, tree).resize(count); });
}

// Makes a leaf of 1 to 8 different primitives in any order. Triangles share at most 8 vertices. Positions are
// multiplied by `scale`.
[[nodiscard]] LeafBlock make_leaf(TriangleTraits, const std::uint32_t* primitives, std::uint32_t count,
                                  const Mesh& mesh, float scale) noexcept;
[[nodiscard]] CurveLeaf make_leaf(CurveTraits, const std::uint32_t* primitives, std::uint32_t count, const Mesh& mesh,
                                  float scale) noexcept;

// Loads one of a mesh's positions into a register. The fourth lane gets the bytes that follow it.
[[nodiscard]] inline Float4 load_position(const Vec3f* position) noexcept {
  static_assert(sizeof(Vec3f) + kReadableBehind >= sizeof(Float4));
  return Float4::load_unaligned(position);
}

// Stores the extent of the vertices in a block whose corners are known.
void write_span(LeafBlock& block, const Box4& box) noexcept;

// Writes the 8 vertices with these numbers, times `scale`, into a block whose corners are known. Returns their box, in
// which zeros may have either sign.
Box4 write_vertices(LeafBlock& block, const std::uint32_t* vertices, const Mesh& mesh, float scale) noexcept;

// Sorts 1 to 8 numbers in ascending order, so that the first of several equal hits in a leaf wins ties. Entries past
// count repeat the last number.
void write_sorted(const std::uint32_t* numbers, std::uint32_t count, std::uint32_t* sorted) noexcept;

template <class Kind>
[[nodiscard]] PointLeaf make_leaf(Kind, const std::uint32_t* primitives, std::uint32_t count, const Mesh& /*mesh*/,
                                  float /*scale*/) noexcept {
  PointLeaf leaf;
  write_sorted(primitives, count, leaf.primitives);
  return leaf;
}

// Leaf refit ----------------------------------------------------------------------------------------------------------
// Updates the leaves of a wide tree after their primitives moved.

// Refits the leaves in these rows of `from` to the mesh's positions, and writes them to `to` (which may be the same
// tree) in the scale of `to`. Writes the box of each to `boxes`, with positive zeros and undefined fourth lanes.
// `vertices` are those of `from`.
void refit_leaves(const WideBvh& from, const LeafVertices& vertices, const Mesh& mesh,
                  std::span<const std::uint32_t> rows, WideBvh& to, Box4* boxes) noexcept;

}  // namespace perfect_bvh
