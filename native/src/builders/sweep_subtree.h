// The lower levels of a sweep build: a few thousand references in their own array, close together in cache, with their
// three orders as 16-bit numbers. Their boxes are snapped to finer grids as nodes get smaller.
// In: the three orders from the upper levels. Out: splits and leaves, in the form that top_down.h requires of a worker.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "builders/builder.h"
#include "builders/bvh2.h"
#include "builders/grid.h"
#include "builders/top_down.h"
#include "core/aligned.h"

namespace perfect_bvh {

struct SweepRange : BuildRange {
  GridFrame frame;
};

class SweepSubtree {
 public:
  using Orders = std::array<std::span<const GridRef>, 3>;

  // `number_of` has room for a number for each position in `prims`; entries of other subtrees are not touched.
  SweepSubtree(std::span<const PrimRef> prims, const BuildConfig& config, const SweepRange& range, const Orders& orders,
               std::uint16_t* number_of);

  bool split(SweepRange& range, SweepRange& left, SweepRange& right);
  Box4 write_leaf(const SweepRange& range, std::uint32_t* prim_indices) const noexcept;

 private:
  using Number = std::uint16_t;  // of a reference in this subtree

  [[nodiscard]] GridBox measure(const SweepRange& range) const noexcept;
  GridBox snap(const SweepRange& range) noexcept;
  // These move the left side to the front of the orders and return its size; 0: a leaf is as good.
  [[nodiscard]] std::uint32_t divide_few(const SweepRange& range, float area) noexcept;
  [[nodiscard]] std::uint32_t divide_at_plane(const SweepRange& range, float area) noexcept;
  [[nodiscard]] std::uint32_t divide_in_halves(const SweepRange& range) noexcept;
  void divide_at(const SweepRange& range, std::size_t split_axis, std::uint32_t left_count) noexcept;
  [[nodiscard]] Number* order(const SweepRange& range, std::size_t axis) noexcept {
    return orders_[axis].data() + (range.begin - begin_);
  }
  [[nodiscard]] const Number* order(const SweepRange& range, std::size_t axis) const noexcept {
    return orders_[axis].data() + (range.begin - begin_);
  }

  std::span<const PrimRef> prims_;
  const BuildConfig& config_;
  const std::uint32_t begin_;  // the subtree's first row
  AlignedVector<GridRef> refs_;
  std::array<std::vector<Number>, 3> orders_;
  std::vector<Number> scratch_;
  std::vector<std::uint8_t> is_left_;
  AlignedVector<Float4> right_costs_;
};

}  // namespace perfect_bvh
