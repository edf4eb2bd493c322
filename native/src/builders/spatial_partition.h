// Which side of a split each reference of a range goes to. What a cut through space divides goes to both, with the
// boxes of its parts, unless it costs less to leave it whole (Stich, Friedrich, Dietrich 2009, section 4.4, "reference
// unsplitting").
// In: references, and an object split or a plane. Out: what lies on each side; the references moved there.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "builders/primitives.h"
#include "builders/spatial_plane.h"
#include "core/aligned.h"
#include "core/steps.h"
#include "math/float4.h"

namespace perfect_bvh {

// What a split would put on either side.
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

  // An object split: every reference goes to one side.
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

  // A spatial split by a plane that the search has found. Where one side would get nothing, or both together more than
  // it allows, or would cost as much as its limit, it is none, and references go where they went before.
  [[nodiscard]] Sides part(std::span<const PrimRef> refs, const SpatialPlane& plane, const SpatialSearch& search,
                           CancelToken& cancel);

  // Moves what goes to the left to the front of `refs`, and what goes to the right to `right`, for which there is room.
  void move(std::span<PrimRef> refs, PrimRef* right, std::uint32_t right_count, CancelToken& cancel);

 private:
  struct Parts {
    Box4 left, right;
  };

  // Where a reference goes, added to the sides; what is cut is added to the parts.
  [[nodiscard]] PlaneSide plan_row(const PrimRef& ref, const SpatialPlane& plane, const SpatialSearch& search,
                                   SpatialPlane& now, Sides& sides);

  std::vector<PlaneSide> sides_, planned_;  // of each row; kBoth: the next of parts_
  std::vector<Parts> parts_;
  AlignedVector<PrimRef> moved_;
};

}  // namespace perfect_bvh
