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
    std::uint32_t& other_count = left ? now.right_count : now.left_count;  // perhaps an estimate
    if (other_count > 1) --other_count;
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

PlaneSide SpatialPartition::plan_row(const PrimRef& ref, const SpatialPlane& plane, const SpatialSearch& search,
                                     SpatialPlane& now, Sides& sides) {
  const Box4 box = Box4::load(&ref);
  PlaneSide side = side_of(ref, plane.axis, plane.place);
  std::array<Box4, 2> slices;
  if (side == PlaneSide::kBoth) {
    slice_reference(ref, plane.axis, {&plane.place, 1}, search.clipper, slices.data());
    side = unsplit(now, box, slices, search.scale);
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

Sides SpatialPartition::part(std::span<const PrimRef> refs, const SpatialPlane& plane, const SpatialSearch& search,
                             CancelToken& cancel) {
  SpatialPlane now = plane;
  Sides sides;
  parts_.clear();
  planned_.resize(refs.size());
  for_steps(refs.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) planned_[i] = plan_row(refs[i], plane, search, now, sides);
  });
  if (!sides.is_split() || sides.left_count + sides.right_count > search.most_references) return {};
  if (!(sides.cost(search.scale) < search.limit)) return {};
  std::swap(sides_, planned_);
  return sides;
}

// Each reference is written to both sides, and stays where the side's end moves on: no branch to be guessed. On the
// left that is never beyond the row it was read from.
void SpatialPartition::move(std::span<PrimRef> refs, PrimRef* right, std::uint32_t right_count, CancelToken& cancel) {
  moved_.resize(right_count + 1);
  PrimRef *to_left = refs.data(), *to_right = moved_.data();
  const Parts* parts = parts_.data();
  for_steps(refs.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const PrimRef ref = refs[i];
      *to_right = ref;
      *to_left = ref;
      if (sides_[i] == PlaneSide::kBoth) {
        set_box(*to_left, parts->left);
        set_box(*to_right, parts->right);
        ++parts;
      }
      to_left += sides_[i] != PlaneSide::kRight;
      to_right += sides_[i] != PlaneSide::kLeft;
    }
  });
  for_steps(right_count, cancel, [&](std::size_t begin, std::size_t end) {
    std::copy(moved_.data() + begin, moved_.data() + end, right + begin);
  });
}

}  // namespace perfect_bvh
