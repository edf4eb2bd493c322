// The best plane to cut space at (Stich, Friedrich, Dietrich 2009, section 4): references that cross it count on both
// sides, with the boxes of their slices.
// In: references whose boxes may be clipped already, a clipper. Out: the plane of least cost, what lies on its sides.
#pragma once

#include <cstdint>
#include <span>

#include "builders/primitives.h"
#include "math/float4.h"

namespace perfect_bvh {

// Areas in coordinates multiplied by a power of two that brings the largest near 1, so that neither huge nor tiny data
// over- or underflow.
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

// The boxes of a reference's parts left and right of planes on `axis` that its box crosses; see PrimClipper::slice.
// One may be empty. Exactly one box more than planes.
void slice_reference(const PrimRef& ref, int axis, std::span<const float> planes, const PrimClipper* clipper,
                     Box4* slices) noexcept;

// What a plane is looked for among, and by.
struct SpatialSearch {
  const PrimClipper* clipper = nullptr;  // null: primitives fill their boxes
  AreaScale scale;
  std::uint32_t bin_count = 2;        // an axis, at most kMaxSpatialBins
  std::uint32_t stride = 1;           // 1: every reference is looked at; 2: every second; ...
  float limit = 0.0f;                 // what the plane must cost less than
  std::uint32_t most_references = 0;  // that it may make
};

// The cheapest of bin_count - 1 equidistant planes an axis, as far as the sample tells: costs and counts are estimates
// unless every reference is looked at. `box` is the union of the references' boxes.
[[nodiscard]] SpatialPlane find_spatial_plane(std::span<const PrimRef> refs, const Box4& box,
                                              const SpatialSearch& search) noexcept;

inline constexpr std::uint32_t kMaxSpatialBins = 128;  // half of the most that settings allow

[[nodiscard]] inline bool is_empty(const Box4& box) noexcept {
  constexpr std::uint32_t kThreeLanes = 0b111;
  return (equal_lanes(less(box.upper, box.lower), Int4(0)) & kThreeLanes) != kThreeLanes;
}

}  // namespace perfect_bvh
