// The boxes of a wide tree, as they are stored: in the tree's scale; and that scale.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "math/aabb.h"
#include "math/float4.h"
#include "math/slab.h"
#include "mesh/mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

[[nodiscard]] inline Vec3f magnitude_of(const Aabb& box) noexcept {
  return {larger(magnitude(box.lower.x), magnitude(box.upper.x)),
          larger(magnitude(box.lower.y), magnitude(box.upper.y)),
          larger(magnitude(box.lower.z), magnitude(box.upper.z))};
}

// The power of two that a tree's coordinates are stored times, so that products of them stay within the range of
// float: 1 for ordinary ones; otherwise what brings the largest into [1, 2).
[[nodiscard]] inline float tree_scale(const Aabb& box) noexcept {
  const Vec3f size = magnitude_of(box);
  const float reach = std::max({size.x, size.y, size.z});
  if (!(reach > 0.0f) || (reach >= 0x1p-20f && reach <= 0x1p20f)) return 1.0f;
  // The power must be a normal number itself.
  return std::ldexp(1.0f, std::clamp(-std::ilogb(reach), -126, 126));
}

// Of a tree with this box, as stored times `scale`.
[[nodiscard]] inline TreeExtent tree_extent(const Aabb& box, float scale) noexcept {
  const Vec3f size = magnitude_of(box) * scale;
  return {{size.x, size.y, size.z}, std::max({size.x, size.y, size.z})};
}

// Empty for a place that is not taken.
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

// All 8 of them; the fourth lanes of the boxes are not looked at.
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

// Of all its children.
[[nodiscard]] inline Aabb node_box(const WideNode& node) noexcept {
  Aabb box;
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) box.grow(child_box(node, lane));
  return box;
}

// The eight places of a leaf of whatever kind. The last of its triangles is repeated.
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

// Of whole triangles, which a clipped box above the leaf may not hold.
[[nodiscard]] inline Aabb leaf_box(const WideBvh& tree, const Mesh& mesh, std::uint32_t leaf) noexcept {
  Aabb box;
  for (std::uint32_t i = 0; i < 8; ++i) box.grow(mesh.primitive_box(primitives_of(tree, leaf)[i]));
  return {box.lower * tree.scale, box.upper * tree.scale};
}

// Of a tree over the mesh's triangles; empty for an empty tree.
[[nodiscard]] inline Aabb bounds_of(const WideBvh& tree, const Mesh& mesh) noexcept {
  if (tree.is_empty) return {};
  return tree.root < kBlockChild ? node_box(tree.nodes[tree.root]) : leaf_box(tree, mesh, tree.root - kBlockChild);
}

// The same at the mesh's own scale.
[[nodiscard]] inline Aabb mesh_bounds_of(const WideBvh& tree, const Mesh& mesh) noexcept {
  const Aabb box = bounds_of(tree, mesh);
  const float to_mesh = 1.0f / tree.scale;
  return box.is_empty() ? box : Aabb{box.lower * to_mesh, box.upper * to_mesh};
}

}  // namespace perfect_bvh
