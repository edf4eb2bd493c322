// What a builder knows of primitives: their boxes and numbers; where it asks, how they are cut and what fits a leaf.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "core/aligned.h"
#include "math/aabb.h"
#include "math/float4.h"

namespace perfect_bvh {

struct alignas(16) PrimRef {
  Vec3f lower;
  std::uint32_t prim_index;
  Vec3f upper;
  std::uint32_t unused;

  [[nodiscard]] constexpr Aabb box() const noexcept { return {lower, upper}; }
  // Twice the centre: the factor is never needed.
  [[nodiscard]] constexpr Vec3f doubled_centroid() const noexcept { return lower + upper; }
};
static_assert(sizeof(PrimRef) == 32);

// What a builder with spatial splits must know of primitives beyond their boxes: where a slice of one lies.
class PrimClipper {
 public:
  virtual ~PrimClipper() = default;

  // Cuts a primitive (by its PrimRef::prim_index) at the planes coordinate[axis] = planes[0] < planes[1] < ... and
  // writes planes.size() + 1 boxes: slices[k] contains every point of the primitive with planes[k - 1] <=
  // coordinate[axis] <= planes[k], both ends included (beyond the first and the last plane: all there is). A slice may
  // be larger than that; it is empty (lower > upper on some axis) only where there is no such point. The fourth lanes
  // may hold anything. Called from many threads at once.
  virtual void slice(std::uint32_t prim_index, int axis, std::span<const float> planes,
                     Box4* slices) const noexcept = 0;
};

// What a builder must know to end where the leaves of the wide tree do: which primitives fit into one of those
// together. A tree that goes on down to one or two primitives costs twice as much to build, and is traced no faster:
// the wide tree's leaves are tested as a whole.
class LeafLimit {
 public:
  virtual ~LeafLimit() = default;

  static constexpr std::uint32_t kMost = 8;  // primitives never fit in larger numbers
  // What fits as a rule, where surfaces share their vertices: by it the leaves of larger sets are counted beforehand.
  static constexpr std::uint32_t kUsual = 6;

  // At most kMost primitives, by their PrimRef::prim_index. One alone always fits, and so does any part of what fits.
  // Called from many threads at once.
  [[nodiscard]] virtual bool fits(std::span<const std::uint32_t> prim_indices) const noexcept = 0;

  // Before fits() is asked: fetches what it reads of a primitive. In line: GCC drops calls that do nothing else.
  [[gnu::always_inline]] void fetch(std::uint32_t prim_index) const noexcept {
    __builtin_prefetch(rows_ + prim_index * row_size_);
  }

 protected:
  LeafLimit(const void* rows, std::size_t row_size) noexcept
      : rows_(static_cast<const char*>(rows)), row_size_(row_size) {}

 private:
  const char* rows_;  // by primitive
  std::size_t row_size_;
};

// Bvh2 ----------------------------------------------------------------------------------------------------------------
// The one tree type that every builder returns: a binary BVH in an array.
// Order of the array: the root is node 0, node 1 is unused, siblings are adjacent at an even index (so that a pair
// shares a cache line), and a parent always stands before its children: refitting is one loop from the last node to
// the first (lecture, "Refitting"). Primitives are referred to by number through `prim_indices`.

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
