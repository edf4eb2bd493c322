// References snapped to a grid. A whole box is in one register, so a union is a single instruction, and moving a
// reference moves 16 bytes. Builders choose their splits by these boxes. The tree's boxes are still exact, because
// leaves take theirs from the references themselves.
//
// A grid has 2^14 steps on its frame's longest axis. When a node's box has shrunk to few steps, its references are
// snapped again to a frame of the node's size.
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
// A node's box with fewer steps on its longest axis is too coarse to compare areas.
inline constexpr int kCoarseSteps = 1024;

// Lanes 0..2: lower corner. Lanes 4..6: upper corner, negated. So the union of two is the minimum in each lane.
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
// Returns the negated sizes in lanes 0..2.
[[nodiscard]] inline Short8 negated_extent(GridBox box) noexcept { return box + box.upper_half(); }
// Returns half the surface area, exactly; undefined for an empty box.
[[nodiscard]] inline std::uint32_t half_area(GridBox box) noexcept { return sum_of_products(negated_extent(box)); }
// Returns twice the centre in lanes 0..2, from 0 to 2 * kGridSteps.
[[nodiscard]] inline Short8 doubled_centroid(GridBox box) noexcept { return box - box.upper_half(); }
[[nodiscard]] int longest_extent(GridBox box) noexcept;
// Returns the half areas of three boxes; the fourth lane is 0.
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
  // Returns the axis on which the centroids spread most.
  [[nodiscard]] int longest_axis() const noexcept;
  // Returns false if all centroids are equal.
  [[nodiscard]] bool has_spread() const noexcept;
};

// The placement of the grid. Coordinates are first multiplied by a power of two, the same for a whole build, that
// brings the largest near 1. So neither huge nor tiny data overflows or underflows.
struct GridFrame {
  Float4 origin;     // of the grid, in multiplied coordinates
  float multiplier;  // the power of two
  float steps;       // grid steps per multiplied unit

  // Returns the frame of the whole build.
  [[nodiscard]] static GridFrame around(const Box4& box) noexcept;
  // Returns the frame of a box given in this one; the same frame if floats have no finer resolution.
  [[nodiscard]] GridFrame around(GridBox box) const noexcept;
  // Returns the frame of a box inside this one.
  [[nodiscard]] GridFrame around_part(const Box4& box) const noexcept;
  // Snaps a box; coordinates outside the frame are moved to its border.
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

// Maps doubled centroids to bins, in integers: rounding cannot push one out of range.
class BinMap {
 public:
  BinMap(const GridBounds& bounds, std::uint32_t bin_count) noexcept;

  // Returns the bins on the three axes in lanes 0..2.
  [[nodiscard]] Short8 operator()(Short8 centroid) const noexcept {
    const Short8 place = centroid - lower_;
    return multiply_high(place + place, scale_);
  }
  // Returns the least doubled centroid that falls into `bin` of `axis`.
  [[nodiscard]] std::int32_t border(std::uint32_t axis, std::uint32_t bin) const noexcept;

 private:
  Short8 lower_, scale_;
};

// The number of references in a part's cost, area * count.
enum class Counting : std::uint8_t {
  kEach,   // every reference is tested separately
  kLeaves  // as many as usually share a leaf (LeafLimit::kUsual) are tested together
};

// A plane between two bins; `bin` is the first of the right side. 0: no plane gains anything.
struct Plane {
  float cost;  // area * count of the left side plus that of the right side
  std::uint32_t axis;
  std::uint32_t bin;
};

// The bins with one number on the three axes: a cache line.
struct alignas(64) Bin {
  std::array<GridBox, 3> boxes;
  std::array<std::int32_t, 4> counts;  // the last is padding
};

class GridBins {
 public:
  explicit GridBins(std::uint32_t bin_count) noexcept;

  // Adds every `stride`-th of the references; only on one axis if `only_axis` is one.
  void add(const GridRef* refs, std::size_t count, std::size_t stride, const BinMap& map, int only_axis) noexcept;
  // Returns the cheapest plane, if it is cheaper than no plane; `count` is the number of references added. When
  // counting leaves, returns the cheapest plane of all.
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
// Divides references on a grid in two: at a plane, or in halves.

// Compares the doubled centroid.
[[nodiscard]] inline bool is_left_of(const GridRef& ref, std::uint32_t axis, std::int32_t border) noexcept {
  return ref.lower[axis] - ref.negated_upper[axis] < border;
}

// Copies references left of the border to `left` and on, the others to `right` and back. Returns the number of left
// ones.
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

// Moves the `half` references with the least centroids on an axis to the front; of equal ones, those first in the
// input.
inline void put_least_first(std::span<GridRef> refs, std::uint32_t half, std::size_t axis, CancelToken& cancel) {
  const auto key = [axis](const GridRef& ref) {
    return std::pair(ref.lower[axis] - ref.negated_upper[axis], ref.position());
  };
  select_nth(refs, half, cancel, [&](const GridRef& a, const GridRef& b) { return key(a) < key(b); });
}

}  // namespace perfect_bvh
