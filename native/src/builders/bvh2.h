// The one tree type that every builder returns: a binary BVH in an array.
// Order of the array: the root is node 0, node 1 is unused, siblings are adjacent at an even index (so that a pair
// shares a cache line), and a parent always stands before its children: refitting is one loop from the last node to
// the first (lecture, "Refitting"). Primitives are referred to by number through `prim_indices`.
#pragma once

#include <cstdint>
#include <type_traits>

#include "core/aligned.h"
#include "math/aabb.h"

namespace perfect_bvh {

// No builder returns a deeper tree: a stack of a fixed size is enough to walk it.
inline constexpr std::uint32_t kMaxTreeDepth = 96;

struct alignas(16) Bvh2Node {
  Vec3f lower;
  std::uint32_t first;  // interior: index of the left child, the right one follows. Leaf: first row of prim_indices.
  Vec3f upper;
  std::uint32_t count;  // 0: interior. Otherwise a leaf of this many primitives.

  [[nodiscard]] constexpr bool is_leaf() const noexcept { return count != 0; }
  [[nodiscard]] constexpr Aabb box() const noexcept { return {lower, upper}; }
  constexpr void set_box(const Aabb& box) noexcept { lower = box.lower, upper = box.upper; }
};
static_assert(sizeof(Bvh2Node) == 32 && std::is_trivially_copyable_v<Bvh2Node>);

struct Bvh2 {
  // Empty for a tree over nothing, one node for a single leaf. Otherwise nodes[1] is padding: an empty box, first and
  // count 0.
  AlignedVector<Bvh2Node> nodes;
  AlignedVector<std::uint32_t> prim_indices;
  std::uint32_t depth = 0;  // levels below the root: 0 for a single leaf; at most kMaxTreeDepth
  // False if boxes are clipped (spatial splits): they say where a part of a primitive is, so no refit can keep them.
  bool refittable = true;
  // Each leaf fits into one leaf of the wide tree, and no node with leaves below it would: the builder saw to it.
  bool has_full_leaves = false;

  [[nodiscard]] bool empty() const noexcept { return nodes.empty(); }
  [[nodiscard]] Aabb bounds() const noexcept { return nodes.empty() ? Aabb{} : nodes[0].box(); }
  // Nodes in use, without the padding.
  [[nodiscard]] std::size_t node_count() const noexcept { return nodes.size() > 1 ? nodes.size() - 1 : nodes.size(); }
  [[nodiscard]] std::size_t byte_count() const noexcept {
    return nodes.size() * sizeof(Bvh2Node) + prim_indices.size() * sizeof(std::uint32_t);
  }
};

}  // namespace perfect_bvh
