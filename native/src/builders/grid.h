// References snapped to a grid: a whole box in one register, so that a union is a single instruction and moving a
// reference moves 16 bytes. Builders choose their splits by these boxes; the tree's boxes are exact all the same,
// since the leaves' come from the references themselves.
//
// A grid has 2^14 steps on its frame's longest axis. Where a node's box has shrunk to few steps, its references are
// snapped again to a frame of its own size.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "builders/top_down.h"
#include "core/cancel.h"
#include "math/float4.h"
#include "math/short8.h"

namespace perfect_bvh {

inline constexpr int kGridSteps = 16383;
// Below so many steps on its longest axis a node's box is too coarse to compare areas by.
inline constexpr int kCoarseSteps = 1024;

// Lanes 0..2: lower corner. Lanes 4..6: upper corner, negated. So the union of two is the minimum of each lane.
using GridBox = Short8;

// A GridBox whose lanes 3 and 7 hold the reference's position in the builder's input.
struct alignas(16) GridRef {
  std::int16_t lower[3];
  std::uint16_t position_low;
  std::int16_t negated_upper[3];
  std::uint16_t position_high;

  [[nodiscard]] std::uint32_t position() const noexcept {
    return position_low | (static_cast<std::uint32_t>(position_high) << 16);
  }
};
static_assert(sizeof(GridRef) == 16);

[[nodiscard]] inline GridBox empty_grid_box() noexcept { return Short8(0x7FFF); }
// Lanes 0..2: the sizes, negated.
[[nodiscard]] inline Short8 negated_extent(GridBox box) noexcept { return box + box.upper_half(); }
// Half the surface area, exact. Of an empty box: some number.
[[nodiscard]] inline std::uint32_t half_area(GridBox box) noexcept { return sum_of_products(negated_extent(box)); }
// Lanes 0..2: twice the centre, 0 to 2 * kGridSteps.
[[nodiscard]] inline Short8 doubled_centroid(GridBox box) noexcept { return box - box.upper_half(); }
[[nodiscard]] int longest_extent(GridBox box) noexcept;
// Half areas of three boxes; the fourth lane is 0.
[[nodiscard]] inline Float4 half_areas(const std::array<GridBox, 3>& boxes) noexcept {
  return to_float(sums_of_products(negated_extent(boxes[0]), negated_extent(boxes[1]), negated_extent(boxes[2])));
}

// The box of references and the bounds of their doubled centroids (lanes 0..2).
struct GridBounds {
  GridBox box = empty_grid_box();
  Short8 centroid_lower{0x7FFF};
  Short8 centroid_upper{-0x8000};

  void grow(GridBox other) noexcept {
    const Short8 centroid = doubled_centroid(other);
    box = min(box, other);
    centroid_lower = min(centroid_lower, centroid);
    centroid_upper = max(centroid_upper, centroid);
  }
  void grow(const GridBounds& other) noexcept {
    box = min(box, other.box);
    centroid_lower = min(centroid_lower, other.centroid_lower);
    centroid_upper = max(centroid_upper, other.centroid_upper);
  }
  // The axis on which the centroids spread most.
  [[nodiscard]] int longest_axis() const noexcept;
  // False if all centroids are the same.
  [[nodiscard]] bool has_spread() const noexcept;
};

// Where the grid lies. Coordinates are first multiplied by a power of two, one for a whole build, that brings the
// largest near 1: neither huge nor tiny data then over- or underflows.
struct GridFrame {
  Float4 origin;     // of the grid, in multiplied coordinates
  float multiplier;  // the power of two
  float steps;       // grid steps per multiplied unit

  // The frame of everything.
  [[nodiscard]] static GridFrame around(const Box4& box) noexcept;
  // The frame of a box given in this one; the same if floats have no finer detail to offer.
  [[nodiscard]] GridFrame around(GridBox box) const noexcept;
  // The frame of a box that lies in this one's.
  [[nodiscard]] GridFrame around_part(const Box4& box) const noexcept;
  // Whatever lies outside the frame comes to lie on its border.
  [[nodiscard]] Short8 snap(const Box4& box, std::uint32_t position) const noexcept {
    const Float4 zero(0.0f), last(static_cast<float>(kGridSteps));
    const Float4 lower = (box.lower.xyz0() * Float4(multiplier) - origin) * Float4(steps);
    const Float4 upper = (box.upper.xyz0() * Float4(multiplier) - origin) * Float4(steps);
    return round_to_short(min(max(lower, zero), last), zero - min(max(upper, zero), last))
        .with_lane<3>(position & 0xFFFFu)
        .with_lane<7>(position >> 16);
  }
};

// Grid bins -----------------------------------------------------------------------------------------------------------
// Bins: the SAH's planes at a fixed number of intervals along each axis (Wald 2007), over boxes on a grid.
// In: references and the bounds of their centroids. Out: the cheapest plane.

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

// Grid partition ------------------------------------------------------------------------------------------------------
// Dividing references on a grid in two: at a plane, or in halves.

// By its doubled centroid.
[[nodiscard]] inline bool is_left_of(const GridRef& ref, std::uint32_t axis, std::int32_t border) noexcept {
  return ref.lower[axis] - ref.negated_upper[axis] < border;
}

// Copies what lies left of the border to `left` and on, the rest to `right` and back. Returns how many are left.
inline std::size_t partition(const GridRef* from, std::size_t count, std::uint32_t axis, std::int32_t border,
                             GridRef* left, GridRef* right) noexcept {
  const GridRef* const first_left = left;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_left = is_left_of(from[i], axis, border);
    Short8::load(&from[i]).store(is_left ? left : right);
    left += is_left;
    right -= !is_left;
  }
  return static_cast<std::size_t>(left - first_left);
}

// Brings the `half` references with the least centroids on an axis to the front; of equal ones those that come first
// in the input.
inline void put_least_first(std::span<GridRef> refs, std::uint32_t half, std::size_t axis, CancelToken& cancel) {
  const auto key = [axis](const GridRef& ref) {
    return std::pair(ref.lower[axis] - ref.negated_upper[axis], ref.position());
  };
  select_nth(refs, half, cancel, [&](const GridRef& a, const GridRef& b) { return key(a) < key(b); });
}

}  // namespace perfect_bvh
