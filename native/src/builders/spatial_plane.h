// Finds the best plane to cut space at (Stich, Friedrich, Dietrich 2009, section 4). References that cross it count on
// both sides, with the boxes of their slices.
// In: references whose boxes may already be clipped, a clipper. Out: the plane of least cost, and the boxes and counts
// of its sides.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "builders/bvh2.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "math/float4.h"

namespace perfect_bvh {

// Computes areas in coordinates multiplied by a power of two that brings the largest near 1, so that neither huge nor
// tiny data overflows or underflows.
struct AreaScale {
  float multiplier = 1.0f;

  [[nodiscard]] float half_area(const Box4& box) const noexcept {
    const Float4 factor(multiplier);
    return perfect_bvh::half_area(box.upper.xyz0() * factor - box.lower.xyz0() * factor);
  }
};

struct SpatialPlane {
  float cost;     // area * count of the left side plus that of the right
  int axis = -1;  // none found
  float place = 0.0f;
  std::uint32_t left_count = 0, right_count = 0;  // references that cross it count twice
  Box4 left, right;
};

enum class PlaneSide : std::uint8_t { kLeft, kRight, kBoth };

// Boxes that end at the plane do not cross it.
[[nodiscard]] inline PlaneSide side_of(const PrimRef& ref, int axis, float place) noexcept {
  if (ref.lower[axis] >= place) return PlaneSide::kRight;
  return ref.upper[axis] > place ? PlaneSide::kBoth : PlaneSide::kLeft;
}

// Computes the boxes of a reference's parts left and right of planes on `axis` that its box crosses; see
// PrimClipper::slice. One may be empty. There is exactly one box more than planes.
void slice_reference(const PrimRef& ref, int axis, std::span<const float> planes, const PrimClipper* clipper,
                     Box4* slices) noexcept;

// The inputs of a plane search.
struct SpatialSearch {
  const PrimClipper* clipper = nullptr;  // null: primitives are assumed to fill their boxes
  AreaScale scale;
  std::uint32_t bin_count = 2;        // per axis, at most kMaxSpatialBins
  std::uint32_t stride = 1;           // 1: every reference is used; 2: every second; ...
  float limit = 0.0f;                 // the plane must cost less than this
  std::uint32_t most_references = 0;  // maximum number after the cut
};

// Returns the cheapest of bin_count - 1 equidistant planes per axis, according to the sample: costs and counts are
// estimates unless every reference is used. `box` is the union of the references' boxes.
[[nodiscard]] SpatialPlane find_spatial_plane(std::span<const PrimRef> refs, const Box4& box,
                                              const SpatialSearch& search) noexcept;

inline constexpr std::uint32_t kMaxSpatialBins = 128;  // half of the maximum in the settings

[[nodiscard]] inline bool is_empty(const Box4& box) noexcept {
  constexpr std::uint32_t kThreeLanes = 0b111;
  return (equal_lanes(less(box.upper, box.lower), Int4(0)) & kThreeLanes) != kThreeLanes;
}

// Spatial partition ---------------------------------------------------------------------------------------------------
// Decides the side of a split for each reference of a range. References that a spatial cut divides go to both sides,
// with the boxes of their parts, unless it costs less to leave them whole (Stich, Friedrich, Dietrich 2009, section
// 4.4, "reference unsplitting").
// In: references, and an object split or a plane. Out: boxes and counts of both sides; the references moved there.

// The boxes and counts of the two sides of a split.
struct Sides {
  Box4 left = Box4::empty(), right = Box4::empty();
  std::uint32_t left_count = 0, right_count = 0;

  void add(bool is_left, const Box4& box) noexcept {
    (is_left ? left : right).grow(box);
    ++(is_left ? left_count : right_count);
  }
  [[nodiscard]] bool is_split() const noexcept { return left_count > 0 && right_count > 0; }
  [[nodiscard]] float cost(const AreaScale& scale) const noexcept {
    return scale.half_area(left) * static_cast<float>(left_count) +
           scale.half_area(right) * static_cast<float>(right_count);
  }
  [[nodiscard]] float overlap(const AreaScale& scale) const noexcept {
    const Box4 common{max(left.lower, right.lower), min(left.upper, right.upper)};
    return is_empty(common) ? 0.0f : scale.half_area(common);
  }
};

class SpatialPartition {
 public:
  void resize(std::size_t count) { sides_.resize(count); }

  // For an object split: every reference goes to one side.
  void set(std::size_t row, bool is_left) noexcept { sides_[row] = is_left ? PlaneSide::kLeft : PlaneSide::kRight; }
  template <class IsLeft>
  [[nodiscard]] Sides assign(std::span<const PrimRef> refs, CancelToken& cancel, const IsLeft& is_left) {
    Sides sides;
    for_steps(refs.size(), cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const bool left = is_left(i);
        set(i, left);
        sides.add(left, Box4::load(&refs[i]));
      }
    });
    return sides;
  }

  // Plans a spatial split by a plane that the search has found. If one side would be empty, or both together would have
  // more references than allowed, or would cost as much as the limit, there is no split, and the sides of references
  // stay as before.
  [[nodiscard]] Sides part(std::span<const PrimRef> refs, const SpatialPlane& plane, const SpatialSearch& search,
                           CancelToken& cancel);

  // Moves left references to the front of `refs`, and right ones to `right`, which has room for them.
  void move(std::span<PrimRef> refs, PrimRef* right, std::uint32_t right_count, CancelToken& cancel);

 private:
  struct Parts {
    Box4 left, right;
  };

  // Chooses the side of a reference and adds it to the sides; if it is cut, its two halves are added to the parts.
  [[nodiscard]] PlaneSide plan_row(const PrimRef& ref, const SpatialPlane& plane, const SpatialSearch& search,
                                   SpatialPlane& now, Sides& sides);

  std::vector<PlaneSide> sides_, planned_;  // of each row; kBoth: the next entry of parts_
  std::vector<Parts> parts_;
  AlignedVector<PrimRef> moved_;
};

}  // namespace perfect_bvh
