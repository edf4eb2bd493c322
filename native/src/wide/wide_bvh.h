// The tree that rays are traced through. Nodes have 8 children, leaves up to 8 triangles. All instruction sets share
// the same bytes. Both levels use it: over the triangles of a mesh, and over instances.
//
// A triangle leaf stores each of its vertices once, and a 3-bit index for each corner of a triangle. A kernel moves and
// shears 8 vertices, then distributes them to the corners by register permutation. Compared with nine floats per
// triangle, this halves the bytes read and takes no longer. The drawback is that a leaf is full at 8 vertices.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "core/aligned.h"
#include "math/aabb.h"
#include "math/float4.h"
#include "math/slab.h"
#include "mesh/primitive_traits.h"

namespace perfect_bvh {

inline constexpr std::uint32_t kWideWidth = 8;

// The kind of a child, in its highest bits. 0: a node, by row. 10: a leaf, by row. 110: an instance, by row (the top
// level's leaves). 111: reserved for the kernels' marks on their stacks. No child is row 0 of the nodes, which is the
// root. So 0 marks an empty slot, whose box is inverted so that no ray enters it.
inline constexpr std::uint32_t kBlockChild = 0x80000000u;
inline constexpr std::uint32_t kInstanceChild = 0xC0000000u;
inline constexpr std::uint32_t kFirstMark = 0xE0000000u;
inline constexpr std::uint32_t kMostBlocks = kInstanceChild - kBlockChild;
inline constexpr std::uint32_t kMostInstances = kFirstMark - kInstanceChild;
inline constexpr std::uint32_t kNoChild = 0;

struct alignas(64) WideNode {
  float planes[6][8];  // lower x, upper x, lower y, upper y, lower z, upper z of the 8 children
  std::uint32_t child[8];
  // Far to near: for a ray of octant o (bit a set if it runs down axis a), slot i is child (order[i] >> 3 o) & 7.
  std::uint32_t order[8];
};
static_assert(sizeof(WideNode) == 256 && std::is_trivially_copyable_v<WideNode>);

// Unused slots repeat the last vertex or triangle. Testing them is harmless: an equal hit of an equal triangle changes
// nothing. Triangles are sorted by ascending number.
struct alignas(32) LeafBlock {
  float vertices[3][8];  // x, y, z, in the tree's scale
  // Bits 0-2, 4-6, 8-10: a triangle's vertices, in winding order. The upper twenty bits of the first entry hold the
  // upper bits of a float: the sum of the extents of the leaf's box, rounded up (see TriangleRay::edge_slack). A leaf
  // that is a single point, which no ray hits, has those of -infinity. In the other entries they are 0.
  std::uint32_t corners[8];
  std::uint32_t primitives[8];  // number of the triangle in the mesh
};
static_assert(sizeof(LeafBlock) == 160 && std::is_trivially_copyable_v<LeafBlock>);

// The origin of whole steps, in the tree's scale, and the number of steps per unit of it.
struct alignas(16) LeafCorner {
  float at[3];
  float steps;
};

// A leaf of curves. For each segment it holds the axis, from one sphere's centre to the other's, and the larger radius,
// in whole steps from the leaf's corner. The segment lies in the capsule about that axis with that radius. So kernels
// find, eight at a time, the segments that a ray may hit, and read only those from the mesh.
struct alignas(64) CurveLeaf {
  std::uint32_t first[8], last[8];  // bits 0-9, 10-19, 20-29: x, y, z
  std::uint8_t radii[8];            // includes the axis' shift by rounding to steps
  std::uint32_t lanes;              // a bit for each segment; unused slots repeat the last
  std::uint32_t zero = 0;
  LeafCorner corner;
  std::uint32_t primitives[8];  // as in LeafBlock
};
static_assert(sizeof(CurveLeaf) == 128 && std::is_trivially_copyable_v<CurveLeaf>);

// A leaf of primitives that are read from the mesh, such as points.
struct alignas(32) PointLeaf {
  std::uint32_t primitives[8];  // as in LeafBlock
};
static_assert(sizeof(PointLeaf) == 32 && std::is_trivially_copyable_v<PointLeaf>);

// Returns a tree's leaves for a kind. Kinds without their own leaf format use PointLeaf, which has only numbers.
constexpr auto& leaves_of(auto /*kind*/, auto& tree) noexcept { return tree.point_leaves; }
constexpr auto& leaves_of(TriangleTraits, auto& tree) noexcept { return tree.blocks; }
constexpr auto& leaves_of(CurveTraits, auto& tree) noexcept { return tree.curve_leaves; }

struct WideBvh {
  AlignedVector<WideNode> nodes;
  // Only one of the three is used, for triangles, curves or points. All are empty in a top level.
  AlignedVector<LeafBlock> blocks;
  AlignedVector<CurveLeaf> curve_leaves;
  AlignedVector<PointLeaf> point_leaves;
  std::uint32_t root = kNoChild;   // a node (row 0) or a leaf
  std::uint32_t depth = 0;         // nodes on the longest path from the root to a leaf
  bool is_empty = true;            // over no primitives: `root` means nothing
  bool repeats_triangles = false;  // spatial splits: a triangle may be in several leaves
  // Boxes and vertices are stored times this power of two. It is 1, unless the coordinates are so large or so small
  // that products of them would leave the range of float.
  float scale = 1.0f;
  TreeExtent extent{};  // of the boxes as stored

  [[nodiscard]] std::size_t leaf_count() const noexcept {
    return blocks.size() + curve_leaves.size() + point_leaves.size();
  }
  [[nodiscard]] std::size_t byte_count() const noexcept {
    return nodes.size() * sizeof(WideNode) + blocks.size() * sizeof(LeafBlock) +
           curve_leaves.size() * sizeof(CurveLeaf) + point_leaves.size() * sizeof(PointLeaf);
  }
};

// Wide boxes ----------------------------------------------------------------------------------------------------------
// The stored boxes of a wide tree, which are in the tree's scale, and that scale.

[[nodiscard]] inline Vec3f magnitude_of(const Aabb& box) noexcept {
  return {larger(magnitude(box.lower.x), magnitude(box.upper.x)),
          larger(magnitude(box.lower.y), magnitude(box.upper.y)),
          larger(magnitude(box.lower.z), magnitude(box.upper.z))};
}

// Returns the power of two that a tree's coordinates are multiplied by, so that products of them stay within the range
// of float. It is 1 for ordinary coordinates; otherwise it brings the largest into [1, 2). Trees of large coordinates
// then lose detail below 2^-126 of the largest, where floats are denormal.
[[nodiscard]] inline float tree_scale(const Aabb& box) noexcept {
  const Vec3f size = magnitude_of(box);
  const float reach = std::max({size.x, size.y, size.z});
  if (!(reach > 0.0f) || (reach >= 0x1p-20f && reach <= 0x1p20f)) return 1.0f;
  // The power must be a normal number itself.
  return std::ldexp(1.0f, std::clamp(-std::ilogb(reach), -126, 126));
}

// Returns the extent of a tree with this box, stored times `scale`.
[[nodiscard]] inline TreeExtent tree_extent(const Aabb& box, float scale) noexcept {
  const Vec3f size = magnitude_of(box) * scale;
  return {{size.x, size.y, size.z}, std::max({size.x, size.y, size.z})};
}

// Returns an empty box for an unused slot.
[[nodiscard]] inline Aabb child_box(const WideNode& node, std::uint32_t lane) noexcept {
  return {{node.planes[0][lane], node.planes[2][lane], node.planes[4][lane]},
          {node.planes[1][lane], node.planes[3][lane], node.planes[5][lane]}};
}

[[nodiscard]] inline Aabb to_aabb(const Box4& box) noexcept {
  alignas(16) float corners[8];
  box.lower.store(&corners[0]);
  box.upper.store(&corners[4]);
  return {{corners[0], corners[1], corners[2]}, {corners[4], corners[5], corners[6]}};
}

// Writes all 8 boxes. Their fourth lanes are ignored.
inline void write_planes(const Box4* boxes, WideNode& node) noexcept {
  for (std::uint32_t first = 0; first < kWideWidth; first += 4) {
    Float4 lower[4], upper[4];
    for (std::uint32_t i = 0; i < 4; ++i) lower[i] = boxes[first + i].lower, upper[i] = boxes[first + i].upper;
    transpose(lower[0], lower[1], lower[2], lower[3]);
    transpose(upper[0], upper[1], upper[2], upper[3]);
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      lower[axis].store(&node.planes[2 * axis][first]);
      upper[axis].store(&node.planes[2 * axis + 1][first]);
    }
  }
}

// Returns the box around all children.
[[nodiscard]] inline Aabb node_box(const WideNode& node) noexcept {
  Aabb box;
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) box.grow(child_box(node, lane));
  return box;
}

// Returns the eight entries of a leaf of any kind. The last primitive is repeated.
[[nodiscard]] inline const std::uint32_t* primitives_of(const WideBvh& tree, std::uint32_t leaf) noexcept {
  if (!tree.blocks.empty()) return tree.blocks[leaf].primitives;
  return tree.curve_leaves.empty() ? tree.point_leaves[leaf].primitives : tree.curve_leaves[leaf].primitives;
}

[[nodiscard]] inline std::uint32_t triangle_count_of(const WideBvh& tree, std::uint32_t leaf) noexcept {
  const std::uint32_t* const primitives = primitives_of(tree, leaf);
  std::uint32_t count = 1;
  for (int i = 1; i < 8; ++i) count += primitives[i] != primitives[i - 1] ? 1u : 0u;
  return count;
}

// Returns the box of whole triangles, which may be larger than a clipped box above the leaf.
[[nodiscard]] inline Aabb leaf_box(const WideBvh& tree, const Mesh& mesh, std::uint32_t leaf) noexcept {
  Aabb box;
  for (std::uint32_t i = 0; i < 8; ++i) box.grow(mesh.primitive_box(primitives_of(tree, leaf)[i]));
  return {box.lower * tree.scale, box.upper * tree.scale};
}

// Returns the bounds of a tree over the mesh's triangles; an empty box for an empty tree.
[[nodiscard]] inline Aabb bounds_of(const WideBvh& tree, const Mesh& mesh) noexcept {
  if (tree.is_empty) return {};
  return tree.root < kBlockChild ? node_box(tree.nodes[tree.root]) : leaf_box(tree, mesh, tree.root - kBlockChild);
}

// Like bounds_of(), but in the mesh's own scale.
[[nodiscard]] inline Aabb mesh_bounds_of(const WideBvh& tree, const Mesh& mesh) noexcept {
  const Aabb box = bounds_of(tree, mesh);
  const float to_mesh = 1.0f / tree.scale;
  return box.is_empty() ? box : Aabb{box.lower * to_mesh, box.upper * to_mesh};
}

}  // namespace perfect_bvh
