#include "builders/spatial_plane.h"

#include <algorithm>
#include <array>
#include <utility>

namespace perfect_bvh {
namespace {

struct SpatialBin {
  Box4 box;
  std::uint32_t entries, exits;  // references that begin or end in this bin
};

// Bins of equal width between the ends of a box, on three axes at once. place(axis, k) is the border between the bins k
// - 1 and k.
class BinGrid {
 public:
  BinGrid(const Box4& box, std::uint32_t bin_count) noexcept
      : count_(bin_count), last_(static_cast<float>(bin_count - 1)), low_(box.lower.xyz0()) {
    // Slightly less, so that rounding never exceeds the right bin, and one comparison with a border decides.
    constexpr float kSlightlyLess = 1.0f - 0x1p-21f;
    const Float4 extent = box.upper.xyz0() - low_;
    step_ = extent * Float4(1.0f / static_cast<float>(bin_count));
    per_unit_ = Float4(static_cast<float>(bin_count) * kSlightlyLess) / extent;
    alignas(16) std::array<float, 4> low, high, step;
    low_.store(low.data());
    box.upper.store(high.data());
    step_.store(step.data());
    for (std::size_t axis = 0; axis < 3; ++axis) set_places(axis, low[axis], high[axis], step[axis]);
  }

  [[nodiscard]] std::uint32_t bin_count() const noexcept { return count_; }
  // Returns false if floats are too coarse, or too large, for this number of bins.
  [[nodiscard]] bool is_usable(std::size_t axis) const noexcept { return usable_[axis]; }
  [[nodiscard]] float place(std::size_t axis, std::uint32_t k) const noexcept { return places_[axis][k]; }
  [[nodiscard]] std::span<const float> between(std::size_t axis, std::uint32_t first_bin,
                                               std::uint32_t last_bin) const noexcept {
    return {places_[axis].data() + first_bin + 1, last_bin - first_bin};
  }

  // The bins of the three axes that a box overlaps, by the rule of side_of().
  struct Reach {
    alignas(16) std::array<std::int32_t, 4> first, last;
  };
  [[nodiscard]] Reach reach_of(const PrimRef& ref) const noexcept {
    const Box4 box = Box4::load(&ref);
    const Float4 one(1.0f), lower = box.lower.xyz0(), upper = box.upper.xyz0();
    const Float4 below = guess(lower), above = guess(upper);
    const Float4 first = select_less(lower, next_place(below), below, below + one);
    const Float4 last = select_less(next_place(above), upper, above + one, above);
    const Float4 first_bin = min(first, last_);
    Reach reach;
    truncate(first_bin).store(reach.first.data());
    truncate(max(min(last, last_), first_bin)).store(reach.last.data());
    return reach;
  }

 private:
  void set_places(std::size_t axis, float low, float high, float step) noexcept {
    usable_[axis] = true;
    float before = low;
    for (std::uint32_t k = 1; k < count_; ++k) {
      const float here = low + static_cast<float>(k) * step;
      usable_[axis] = usable_[axis] && before < here && here < high;
      before = places_[axis][k] = here;
    }
  }
  // Returns the bin of a coordinate, or the one before. For NaN: the last.
  [[nodiscard]] Float4 guess(Float4 x) const noexcept {
    return to_float(truncate(max(min((x - low_) * per_unit_, last_), Float4(0.0f))));
  }
  [[nodiscard]] Float4 next_place(Float4 bin) const noexcept { return low_ + (bin + Float4(1.0f)) * step_; }

  std::uint32_t count_;
  Float4 last_, low_, step_, per_unit_;
  std::array<bool, 3> usable_;
  std::array<std::array<float, kMaxSpatialBins>, 3> places_;  // from 1 on
};

// A slab between two coordinates of an axis, without bounds on the others.
[[nodiscard]] Box4 slab(int axis, float low, float high) noexcept {
  const Int4 mask(axis == 0 ? -1 : 0, axis == 1 ? -1 : 0, axis == 2 ? -1 : 0, 0);
  const Int4 others = mask ^ Int4(-1);
  return {from_bits((bits_of(Float4(low)) & mask) | (bits_of(Float4(-Aabb::kInfinity)) & others)),
          from_bits((bits_of(Float4(high)) & mask) | (bits_of(Float4(Aabb::kInfinity)) & others))};
}

// The bins of three axes, filled with a sample of references.
class SpatialBins {
 public:
  SpatialBins(const SpatialSearch& search, const Box4& box) noexcept : search_(search), grid_(box, search.bin_count) {
    for (auto& axis : bins_) std::fill_n(axis.begin(), grid_.bin_count(), SpatialBin{Box4::empty(), 0, 0});
  }

  // Counts references, and adds those that cross no plane of an axis.
  void add_whole(std::span<const PrimRef> refs) noexcept {
    for (std::size_t i = 0; i < refs.size(); i += search_.stride, ++sample_count_) {
      const BinGrid::Reach reach = grid_.reach_of(refs[i]);
      const Box4 box = Box4::load(&refs[i]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto first = static_cast<std::size_t>(reach.first[axis]);
        const auto last = static_cast<std::size_t>(reach.last[axis]);
        ++bins_[axis][first].entries;
        ++bins_[axis][last].exits;
        if (first == last) bins_[axis][first].box.grow(box);
      }
    }
    ratio_ = static_cast<double>(refs.size()) / sample_count_;
  }

  // Adds slices. They are costly, so axes on which no plane is possible (too many duplicates) are skipped.
  void add_slices(std::span<const PrimRef> refs) noexcept {
    for (std::size_t axis = 0; axis < 3; ++axis) offers_[axis] = grid_.is_usable(axis) && some_plane_fits(axis);
    if (!offers_[0] && !offers_[1] && !offers_[2]) return;
    for (std::size_t i = 0; i < refs.size(); i += search_.stride) {
      const BinGrid::Reach reach = grid_.reach_of(refs[i]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto first = static_cast<std::uint32_t>(reach.first[axis]);
        const auto last = static_cast<std::uint32_t>(reach.last[axis]);
        if (first != last && offers_[axis]) slice(refs[i], axis, first, last);
      }
    }
  }

  // Returns the cheapest plane of all, if it is below the limit.
  [[nodiscard]] SpatialPlane find_best() const noexcept {
    SpatialPlane best{
        .cost = search_.limit / static_cast<float>(ratio_), .left = Box4::empty(), .right = Box4::empty()};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (offers_[axis]) price_planes(axis, best);
    }
    best.left_count = of_all(best.left_count);
    best.right_count = of_all(best.right_count);
    return best;
  }

 private:
  // Scales a count of the sample to all references.
  [[nodiscard]] std::uint32_t of_all(std::uint32_t count) const noexcept {
    return static_cast<std::uint32_t>(count * ratio_);
  }
  [[nodiscard]] bool fits(std::uint32_t left_count, std::uint32_t right_count) const noexcept {
    return left_count > 0 && right_count > 0 && of_all(left_count + right_count) <= search_.most_references;
  }

  // Returns whether some plane of the axis makes few enough references.
  [[nodiscard]] bool some_plane_fits(std::size_t axis) const noexcept {
    std::uint32_t left_count = 0, right_count = sample_count_;
    for (std::uint32_t k = 0; k + 1 < grid_.bin_count(); ++k) {
      left_count += bins_[axis][k].entries;
      right_count -= bins_[axis][k].exits;
      if (fits(left_count, right_count)) return true;
    }
    return false;
  }

  void slice(const PrimRef& ref, std::size_t axis, std::uint32_t first, std::uint32_t last) noexcept {
    std::array<Box4, kMaxSpatialBins> slices;
    slice_reference(ref, static_cast<int>(axis), grid_.between(axis, first, last), search_.clipper, slices.data());
    for (std::uint32_t k = first; k <= last; ++k) {
      if (!is_empty(slices[k - first])) bins_[axis][k].box.grow(slices[k - first]);
    }
  }

  // Prices every plane of an axis; takes the cheapest if it is better than `best`.
  void price_planes(std::size_t axis, SpatialPlane& best) const noexcept {
    const std::span<const SpatialBin> bins(bins_[axis].data(), grid_.bin_count());
    const AreaScale& scale = search_.scale;
    std::array<Box4, kMaxSpatialBins> right_boxes;
    Box4 box = Box4::empty();
    std::uint32_t right_count = 0;
    for (std::size_t k = bins.size(); k-- > 0;) {
      box.grow(bins[k].box);
      right_boxes[k] = box;
      right_count += bins[k].exits;
    }
    box = Box4::empty();
    std::uint32_t left_count = 0;
    for (std::uint32_t k = 0; k + 1 < bins.size(); ++k) {
      box.grow(bins[k].box);
      left_count += bins[k].entries;
      right_count -= bins[k].exits;
      if (!fits(left_count, right_count)) continue;
      if (is_empty(box) || is_empty(right_boxes[k + 1])) continue;  // the slices were empty
      const float cost = scale.half_area(box) * static_cast<float>(left_count) +
                         scale.half_area(right_boxes[k + 1]) * static_cast<float>(right_count);
      if (!(cost < best.cost)) continue;
      best = {cost, static_cast<int>(axis), grid_.place(axis, k + 1), left_count, right_count, box, right_boxes[k + 1]};
    }
  }

  const SpatialSearch& search_;
  BinGrid grid_;
  std::array<std::array<SpatialBin, kMaxSpatialBins>, 3> bins_;
  std::array<bool, 3> offers_{};
  std::uint32_t sample_count_ = 0;
  double ratio_ = 1.0;  // ratio of all references to the sample
};

}  // namespace

void slice_reference(const PrimRef& ref, int axis, std::span<const float> planes, const PrimClipper* clipper,
                     Box4* slices) noexcept {
  const Box4 box = Box4::load(&ref);
  const std::size_t count = planes.size() + 1;
  if (clipper != nullptr) {
    clipper->slice(ref.prim_index, axis, planes, slices);
  } else {
    std::fill_n(slices, count, box);
  }
  float low = -Aabb::kInfinity;
  for (std::size_t k = 0; k < count; ++k) {
    const float high = k + 1 < count ? planes[k] : Aabb::kInfinity;
    const Box4 cut = slab(axis, low, high);
    slices[k] = {max(max(slices[k].lower, box.lower), cut.lower), min(min(slices[k].upper, box.upper), cut.upper)};
    low = high;
  }
}

SpatialPlane find_spatial_plane(std::span<const PrimRef> refs, const Box4& box, const SpatialSearch& search) noexcept {
  SpatialBins bins(search, box);
  bins.add_whole(refs);
  bins.add_slices(refs);
  return bins.find_best();
}

// Spatial partition ---------------------------------------------------------------------------------------------------

namespace {

void set_box(PrimRef& ref, const Box4& box) noexcept {
  alignas(16) std::array<float, 4> lower, upper;
  box.lower.store(lower.data());
  box.upper.store(upper.data());
  ref.lower = {lower[0], lower[1], lower[2]};
  ref.upper = {upper[0], upper[1], upper[2]};
}

// Decides whether a reference on the plane goes to one side as a whole. `now` has the plane's sides after the
// references before it.
PlaneSide unsplit(SpatialPlane& now, const Box4& box, const std::array<Box4, 2>& slices,
                  const AreaScale& scale) noexcept {
  if (is_empty(slices[0]) || is_empty(slices[1])) {  // its box crosses the plane, but it does not
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

// Writes each reference to both sides, and advances only the end of its own side, which avoids a branch. On the left,
// this never writes beyond the row that was read.
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
