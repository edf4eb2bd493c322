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

// What one leaf has room for: so many different primitives, and where it holds their vertices at most 8 of those.
struct LeafRoom {
  std::uint32_t most = 1;                      // an instance, of a top level
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

// So many leaves of the mesh's kind.
inline void make_room_for_leaves(const Mesh& mesh, std::size_t count, WideBvh& tree) {
  for_each_kind([&](auto kind) { leaves_of(kind, tree).clear(); });
  with_kind(mesh.kind, [&](auto kind) { leaves_of(kind, tree).resize(count); });
}

// From 1 to 8 different primitives, triangles over at most 8 vertices, in any order. Positions are taken times `scale`.
[[nodiscard]] LeafBlock make_leaf(TriangleTraits, const std::uint32_t* primitives, std::uint32_t count,
                                  const Mesh& mesh, float scale) noexcept;
[[nodiscard]] CurveLeaf make_leaf(CurveTraits, const std::uint32_t* primitives, std::uint32_t count, const Mesh& mesh,
                                  float scale) noexcept;

// One of a mesh's positions in a register; what stands behind it is in the fourth lane.
[[nodiscard]] inline Float4 load_position(const Vec3f* position) noexcept {
  static_assert(sizeof(Vec3f) + kReadableBehind >= sizeof(Float4));
  return Float4::load_unaligned(position);
}

// Notes in a block, whose corners are known, how far its vertices extend.
void write_span(LeafBlock& block, const Box4& box) noexcept;

// The 8 vertices with these numbers, times `scale`, into a block whose corners are known. Returns their box, in which
// zeros may have either sign.
Box4 write_vertices(LeafBlock& block, const std::uint32_t* vertices, const Mesh& mesh, float scale) noexcept;

// 1 to 8 numbers by ascending order: then the first of several equal hits in a leaf is the one that wins ties. The
// places past count repeat the last number.
void write_sorted(const std::uint32_t* numbers, std::uint32_t count, std::uint32_t* sorted) noexcept;

template <class Kind>
[[nodiscard]] PointLeaf make_leaf(Kind, const std::uint32_t* primitives, std::uint32_t count, const Mesh& /*mesh*/,
                                  float /*scale*/) noexcept {
  PointLeaf leaf;
  write_sorted(primitives, count, leaf.primitives);
  return leaf;
}

// Leaf refit ----------------------------------------------------------------------------------------------------------
// The leaves of a wide tree, moved to where their primitives are now.

// Writes to `to` what the leaves in these rows of `from` (it may be the same tree) become over the mesh's positions, in
// the scale of `to`, and to `boxes` the box of each: with positive zeros, and fourth lanes that mean nothing.
// `vertices` are those of `from`.
void refit_leaves(const WideBvh& from, const LeafVertices& vertices, const Mesh& mesh,
                  std::span<const std::uint32_t> rows, WideBvh& to, Box4* boxes) noexcept;

}  // namespace perfect_bvh
