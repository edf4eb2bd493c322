// Bins: the SAH's planes at a fixed number of intervals along each axis (Wald 2007), over boxes on a grid.
// In: references and the bounds of their centroids. Out: the cheapest plane.
#pragma once

#include <array>
#include <cstdint>

#include "builders/grid_ref.h"

namespace perfect_bvh {

inline constexpr std::uint32_t kMaxBins = 256;

// Maps doubled centroids to bins, in whole numbers: no rounding can push one out of range.
class BinMap {
 public:
  BinMap(const GridBounds& bounds, std::uint32_t bin_count) noexcept;

  // Lanes 0..2: the bins on the three axes.
  [[nodiscard]] Short8 operator()(Short8 centroid) const noexcept {
    const Short8 place = centroid - lower_;
    return multiply_high(place + place, scale_);
  }
  // The least doubled centroid that falls into `bin` of `axis`.
  [[nodiscard]] std::int32_t border(std::uint32_t axis, std::uint32_t bin) const noexcept;

 private:
  Short8 lower_, scale_;
};

// How a part's references are counted in its cost: area * count.
enum class Counting : std::uint8_t {
  kEach,   // every reference is tested by itself
  kLeaves  // as many as usually share a leaf (LeafLimit::kUsual) are tested at once
};

// A plane between two bins; `bin` is the first of the right side. 0: no plane gains anything.
struct Plane {
  float cost;  // area * count of the left side plus that of the right side
  std::uint32_t axis;
  std::uint32_t bin;
};

// What fell into the bins of the three axes with one number: a cache line.
struct alignas(64) Bin {
  std::array<GridBox, 3> boxes;
  std::array<std::int32_t, 4> counts;  // the last is padding
};

class GridBins {
 public:
  explicit GridBins(std::uint32_t bin_count) noexcept;

  // Every `stride`-th of the references; on one axis alone if `only_axis` names one.
  void add(const GridRef* refs, std::size_t count, std::size_t stride, const BinMap& map, int only_axis) noexcept;
  // The cheapest plane, if it is cheaper than no plane; `count` is how many references were added. Counting leaves:
  // the cheapest plane of all.
  [[nodiscard]] Plane find_best(std::uint32_t count, int only_axis, Counting counting = Counting::kEach) const noexcept;

 private:
  template <Counting kCounting>
  [[nodiscard]] Plane find_best_counting(std::uint32_t count, int only_axis) const noexcept;
  template <int Axis>
  void add_one(Short8 bin, GridBox box) noexcept;
  template <int Axis>
  void add_axis(const GridRef* refs, std::size_t count, std::size_t stride, const BinMap& map) noexcept;

  std::uint32_t size_;
  std::array<Bin, kMaxBins> rows_;
};

}  // namespace perfect_bvh
