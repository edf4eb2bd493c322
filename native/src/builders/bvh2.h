// The data on primitives that builders use: boxes and numbers, and optionally how they are cut and what fits into a
// leaf.
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

// The data on primitives, beyond boxes, that spatial splits need: the box of a slice of a primitive.
class PrimClipper {
 public:
  virtual ~PrimClipper() = default;

  // Cuts a primitive (by its PrimRef::prim_index) at the planes coordinate[axis] = planes[0] < planes[1] < ... and
  // writes planes.size() + 1 boxes. slices[k] contains every point of the primitive with planes[k - 1] <=
  // coordinate[axis] <= planes[k], both ends included; the first and last slices are unbounded on the outside. A slice
  // may be larger than necessary. It is empty (lower > upper on some axis) only if there is no such point. The fourth
  // lanes are undefined. May be called from many threads at once.
  virtual void slice(std::uint32_t prim_index, int axis, std::span<const float> planes,
                     Box4* slices) const noexcept = 0;
};

// Tells a builder which primitives fit together into one leaf of the wide tree, so that its leaves can be the same. A
// tree that continues down to one or two primitives costs twice as much to build, and is traced no faster, because the
// wide tree's leaves are tested as a whole.
class LeafLimit {
 public:
  virtual ~LeafLimit() = default;

  static constexpr std::uint32_t kMost = 8;  // more primitives never fit
  // The number that usually fits, as surfaces share vertices. Used to estimate the leaves of larger sets.
  static constexpr std::uint32_t kUsual = 6;

  // Returns whether at most kMost primitives, by their PrimRef::prim_index, fit. A single one always fits, and so does
  // any subset of a set that fits. May be called from many threads at once.
  [[nodiscard]] virtual bool fits(std::span<const std::uint32_t> prim_indices) const noexcept = 0;

  // Prefetches the data of a primitive that fits() reads. Inlined, because GCC drops calls that only prefetch.
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
// The tree type that every builder returns: a binary BVH in an array.
// Order of the array: the root is node 0, node 1 is unused, and siblings are adjacent at an even index, so that a pair
// shares a cache line. A parent is always before its children, so refitting is one loop from the last node to the first
// (lecture, "Refitting"). Primitives are referred to by number through `prim_indices`.

// No builder returns a deeper tree, so a stack of fixed size is enough to traverse it.
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
  // Empty for a tree without primitives, one node for a single leaf. Otherwise nodes[1] is padding: an empty box, first
  // and count 0.
  AlignedVector<Bvh2Node> nodes;
  AlignedVector<std::uint32_t> prim_indices;
  std::uint32_t depth = 0;  // levels below the root: 0 for a single leaf; at most kMaxTreeDepth
  // False if boxes are clipped (spatial splits): they bound parts of primitives, which a refit cannot keep.
  bool refittable = true;
  // The builder ensured that each leaf fits into one leaf of the wide tree, and that no node above leaves would.
  bool has_full_leaves = false;

  [[nodiscard]] bool empty() const noexcept { return nodes.empty(); }
  [[nodiscard]] Aabb bounds() const noexcept { return nodes.empty() ? Aabb{} : nodes[0].box(); }
  // Returns the number of nodes in use, without the padding.
  [[nodiscard]] std::size_t node_count() const noexcept { return nodes.size() > 1 ? nodes.size() - 1 : nodes.size(); }
};

}  // namespace perfect_bvh
