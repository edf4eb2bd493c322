// What a builder must know to end where the leaves of the wide tree do: which primitives fit into one of those
// together. A tree that goes on down to one or two primitives costs twice as much to build, and is traced no faster:
// the wide tree's leaves are tested as a whole.
#pragma once

#include <cstdint>
#include <span>

namespace perfect_bvh {

class LeafLimit {
 public:
  virtual ~LeafLimit() = default;

  static constexpr std::uint32_t kMost = 8;  // primitives never fit in larger numbers
  // What fits as a rule, where surfaces share their vertices: by it the leaves of larger sets are counted beforehand.
  static constexpr std::uint32_t kUsual = 6;

  // At most kMost primitives, by their PrimRef::prim_index. One alone always fits, and so does any part of what fits.
  // Called from many threads at once.
  [[nodiscard]] virtual bool fits(std::span<const std::uint32_t> prim_indices) const noexcept = 0;
};

}  // namespace perfect_bvh
