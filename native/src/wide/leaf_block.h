// The leaves of a wide tree.
#pragma once

#include <cstdint>
#include <span>

#include "builders/build_config.h"
#include "core/aligned.h"
#include "math/float4.h"
#include "mesh/mesh.h"
#include "wide/small_set.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Whether different triangles fit into one leaf: at most 8 of them; in the default layout over at most 8 vertices.
[[nodiscard]] inline bool fit_one_leaf(std::span<const std::uint32_t> numbers, const TriangleIndices* triangles,
                                       TreeLayout layout) noexcept {
  if (numbers.size() <= 2) return true;  // they have 6 corners
  if (numbers.size() > SmallSet::kMost) return false;
  if (layout == TreeLayout::kCompact) return true;
  SmallSet vertices;
  for (const std::uint32_t number : numbers) {
    const TriangleIndices corners = triangles[number];
    vertices.add(corners.x, corners.y, corners.z);
  }
  return !vertices.overflows();
}

// From 1 to 8 different triangles over at most 8 vertices, in any order. Positions are taken times `scale`.
[[nodiscard]] LeafBlock make_leaf_block(const std::uint32_t* primitives, std::uint32_t count, const Mesh& mesh,
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

// The same triangles as a leaf of the compact layout: 1 to 8, over any number of vertices.
[[nodiscard]] IndexedLeaf make_indexed_leaf(const std::uint32_t* primitives, std::uint32_t count) noexcept;

}  // namespace perfect_bvh
