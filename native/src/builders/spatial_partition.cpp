#include "builders/spatial_partition.h"

#include <algorithm>
#include <array>
#include <utility>

namespace perfect_bvh {
namespace {

void set_box(PrimRef& ref, const Box4& box) noexcept {
  alignas(16) std::array<float, 4> lower, upper;
  box.lower.store(lower.data());
  box.upper.store(upper.data());
  ref.lower = {lower[0], lower[1], lower[2]};
  ref.upper = {upper[0], upper[1], upper[2]};
}

// Whether a reference on the plane goes to one side as a whole; `now` is what the plane's sides have become by those
// before it.
PlaneSide unsplit(SpatialPlane& now, const Box4& box, const std::array<Box4, 2>& slices,
                  const AreaScale& scale) noexcept {
  if (is_empty(slices[0]) || is_empty(slices[1])) {  // its box crosses the plane, itself it does not
    const bool left = is_empty(slices[1]);
    --(left ? now.right_count : now.left_count);
    (left ? now.left : now.right).grow(box);
    return left ? PlaneSide::kLeft : PlaneSide::kRight;
  }
  const auto left_count = static_cast<float>(now.left_count), right_count = static_cast<float>(now.right_count);
  const float left_area = scale.half_area(now.left), right_area = scale.half_area(now.right);
  Box4 wide_left = now.left, wide_right = now.right;
  wide_left.grow(box);
  wide_right.grow(box);
  const float split_cost = left_area * left_count + right_area * right_count;
  const float all_left = scale.half_area(wide_left) * left_count + right_area * (right_count - 1.0f);
  const float all_right = left_area * (left_count - 1.0f) + scale.half_area(wide_right) * right_count;
  if (now.right_count > 1 && all_left < split_cost && all_left <= all_right) {
    now.left = wide_left;
    --now.right_count;
    return PlaneSide::kLeft;
  }
  if (now.left_count > 1 && all_right < split_cost) {
    now.right = wide_right;
    --now.left_count;
    return PlaneSide::kRight;
  }
  return PlaneSide::kBoth;
}

}  // namespace

PlaneSide SpatialPartition::plan_row(const PrimRef& ref, const SpatialPlane& plane, const PrimClipper* clipper,
                                     const AreaScale& scale, SpatialPlane& now, Sides& sides) {
  const Box4 box = Box4::load(&ref);
  PlaneSide side = side_of(ref, plane.axis, plane.place);
  std::array<Box4, 2> slices;
  if (side == PlaneSide::kBoth) {
    slice_reference(ref, plane.axis, {&plane.place, 1}, clipper, slices.data());
    side = unsplit(now, box, slices, scale);
  }
  if (side == PlaneSide::kBoth) {
    parts_.push_back({slices[0], slices[1]});
    sides.add(true, slices[0]);
    sides.add(false, slices[1]);
  } else {
    sides.add(side == PlaneSide::kLeft, box);
  }
  return side;
}

Sides SpatialPartition::part(std::span<const PrimRef> refs, const SpatialPlane& plane, const PrimClipper* clipper,
                             const AreaScale& scale, std::uint32_t most_references, CancelToken& cancel) {
  SpatialPlane now = plane;
  Sides sides;
  parts_.clear();
  planned_.resize(refs.size());
  for_steps(refs.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) planned_[i] = plan_row(refs[i], plane, clipper, scale, now, sides);
  });
  if (!sides.is_split() || sides.left_count + sides.right_count > most_references) return {};
  std::swap(sides_, planned_);
  return sides;
}

void SpatialPartition::move(std::span<PrimRef> refs, PrimRef* right, std::uint32_t right_count, CancelToken& cancel) {
  moved_.clear();
  moved_.reserve(right_count);
  PrimRef* to_left = refs.data();
  const Parts* parts = parts_.data();
  for_steps(refs.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      PrimRef ref = refs[i];
      if (sides_[i] == PlaneSide::kLeft) {
        *to_left++ = ref;
      } else if (sides_[i] == PlaneSide::kRight) {
        moved_.push_back(ref);
      } else {
        set_box(ref, parts->left);
        *to_left++ = ref;
        set_box(ref, parts->right);
        moved_.push_back(ref);
        ++parts;
      }
    }
  });
  for_steps(moved_.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) right[i] = moved_[i];
  });
}

}  // namespace perfect_bvh
