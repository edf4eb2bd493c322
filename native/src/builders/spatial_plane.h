// The best plane to cut space at (Stich, Friedrich, Dietrich 2009, section 4): references that cross it count on both
// sides, with the boxes of their slices.
// In: references whose boxes may be clipped already, a clipper. Out: the plane of least cost, what lies on its sides.
#pragma once

#include <cstdint>
#include <span>

#include "builders/primitives.h"
#include "core/cancel.h"
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

// The cheapest of bin_count - 1 equidistant planes an axis with a cost below `limit` that makes at most
// `most_references` of these. `box` is the union of the references' boxes. Without a clipper primitives fill their
// boxes.
[[nodiscard]] SpatialPlane find_spatial_plane(std::span<const PrimRef> refs, const Box4& box, std::uint32_t bin_count,
                                              const PrimClipper* clipper, const AreaScale& scale, float limit,
                                              std::uint32_t most_references, CancelToken& cancel);

inline constexpr std::uint32_t kMaxSpatialBins = 256;

[[nodiscard]] inline bool is_empty(const Box4& box) noexcept {
  alignas(16) float lower[4], upper[4];
  box.lower.store(lower);
  box.upper.store(upper);
  return !(lower[0] <= upper[0] && lower[1] <= upper[1] && lower[2] <= upper[2]);
}

}  // namespace perfect_bvh
