// What a builder knows of primitives: their boxes and numbers; where it asks, how they are cut and what fits a leaf.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

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

}  // namespace perfect_bvh
