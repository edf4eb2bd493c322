#include "builders/spatial_plane.h"

#include <algorithm>
#include <array>

#include "core/steps.h"

namespace perfect_bvh {
namespace {

struct SpatialBin {
  Box4 box;
  std::uint32_t entries, exits;  // references whose first, whose last bin this is
};

// Planes at equal distances between the ends of a box on one axis; plane k stands between bins k and k + 1.
class Planes {
 public:
  Planes(float low, float high, std::uint32_t bin_count) noexcept
      : count_(bin_count - 1), low_(low), per_unit_(static_cast<float>(bin_count) / (high - low)) {
    const float step = 1.0f / static_cast<float>(bin_count);
    float before = low;
    for (std::uint32_t k = 0; k < count_; ++k) {
      const float share = static_cast<float>(k + 1) * step;
      places_[k] = low * (1.0f - share) + high * share;
      usable_ = usable_ && before < places_[k] && places_[k] < high;
      before = places_[k];
    }
  }

  // False where floats are too coarse, or too large, for so many planes.
  [[nodiscard]] bool usable() const noexcept { return usable_; }
  [[nodiscard]] float place(std::uint32_t k) const noexcept { return places_[k]; }
  [[nodiscard]] std::span<const float> between(std::uint32_t first_bin, std::uint32_t last_bin) const noexcept {
    return {places_.data() + first_bin, last_bin - first_bin};
  }
  // The bins that a box reaches into, by the rule of side_of().
  [[nodiscard]] std::uint32_t first_bin(float lower) const noexcept {
    std::uint32_t bin = guess(lower);
    while (bin > 0 && lower < places_[bin - 1]) --bin;
    while (bin < count_ && lower >= places_[bin]) ++bin;
    return bin;
  }
  [[nodiscard]] std::uint32_t last_bin(float upper) const noexcept {
    std::uint32_t bin = guess(upper);
    while (bin > 0 && upper <= places_[bin - 1]) --bin;
    while (bin < count_ && upper > places_[bin]) ++bin;
    return bin;
  }

 private:
  [[nodiscard]] std::uint32_t guess(float x) const noexcept {
    const float bin = (x - low_) * per_unit_;
    return bin > 0.0f ? static_cast<std::uint32_t>(std::min(bin, static_cast<float>(count_))) : 0;
  }

  std::uint32_t count_;
  float low_, per_unit_;
  bool usable_ = true;
  std::array<float, kMaxSpatialBins> places_;
};

[[nodiscard]] Float4 on_axis(int axis, float place, float elsewhere) noexcept {
  return {axis == 0 ? place : elsewhere, axis == 1 ? place : elsewhere, axis == 2 ? place : elsewhere, elsewhere};
}

void fill_bins(std::span<const PrimRef> refs, int axis, const Planes& planes, const PrimClipper* clipper,
               std::span<SpatialBin> bins) noexcept {
  std::array<Box4, kMaxSpatialBins> slices;
  for (const PrimRef& ref : refs) {
    const std::uint32_t first = planes.first_bin(ref.lower[axis]);
    const std::uint32_t last = std::max(first, planes.last_bin(ref.upper[axis]));
    ++bins[first].entries;
    ++bins[last].exits;
    if (first == last) {
      bins[first].box.grow(Box4::load(&ref));
      continue;
    }
    slice_reference(ref, axis, planes.between(first, last), clipper, slices.data());
    for (std::uint32_t k = first; k <= last; ++k) {
      if (!is_empty(slices[k - first])) bins[k].box.grow(slices[k - first]);
    }
  }
}

// How many references enter and leave each bin.
struct BinCounts {
  std::array<std::uint32_t, kMaxSpatialBins> entries{}, exits{};

  void add(std::span<const PrimRef> refs, int axis, const Planes& planes) noexcept {
    for (const PrimRef& ref : refs) {
      const std::uint32_t first = planes.first_bin(ref.lower[axis]);
      ++entries[first];
      ++exits[std::max(first, planes.last_bin(ref.upper[axis]))];
    }
  }
};

// Whether some plane of the axis leaves few enough references. Counting them is cheap, slicing them is not: where all
// overlap each other (duplicates), there is nothing to slice for.
[[nodiscard]] bool some_plane_fits(std::span<const PrimRef> refs, int axis, const Planes& planes,
                                   std::uint32_t bin_count, std::uint32_t most_references, CancelToken& cancel) {
  BinCounts counts;
  for_steps(refs.size(), cancel,
            [&](std::size_t begin, std::size_t end) { counts.add(refs.subspan(begin, end - begin), axis, planes); });
  auto right_count = static_cast<std::uint32_t>(refs.size());
  std::uint32_t left_count = 0;
  for (std::uint32_t k = 0; k + 1 < bin_count; ++k) {
    left_count += counts.entries[k];
    right_count -= counts.exits[k];
    if (left_count > 0 && right_count > 0 && left_count + right_count <= most_references) return true;
  }
  return false;
}

// Prices every plane of an axis; takes over the cheapest if it beats `best`.
void price_planes(std::span<const SpatialBin> bins, int axis, const Planes& planes, const AreaScale& scale,
                  std::uint32_t most_references, SpatialPlane& best) noexcept {
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
    if (left_count == 0 || right_count == 0 || left_count + right_count > most_references) continue;
    if (is_empty(box) || is_empty(right_boxes[k + 1])) continue;  // slices that were none after all
    const float cost = scale.half_area(box) * static_cast<float>(left_count) +
                       scale.half_area(right_boxes[k + 1]) * static_cast<float>(right_count);
    if (cost < best.cost) best = {cost, axis, planes.place(k), left_count, right_count, box, right_boxes[k + 1]};
  }
}

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
  // Where the planes cut: infinite on the other axes, so that only the planes' own is affected.
  for (std::size_t k = 0; k < count; ++k) {
    Box4 slice{max(slices[k].lower, box.lower), min(slices[k].upper, box.upper)};
    if (k > 0) slice.lower = max(slice.lower, on_axis(axis, planes[k - 1], -Aabb::kInfinity));
    if (k + 1 < count) slice.upper = min(slice.upper, on_axis(axis, planes[k], Aabb::kInfinity));
    slices[k] = slice;
  }
}

SpatialPlane find_spatial_plane(std::span<const PrimRef> refs, const Box4& box, std::uint32_t bin_count,
                                const PrimClipper* clipper, const AreaScale& scale, float limit,
                                std::uint32_t most_references, CancelToken& cancel) {
  SpatialPlane best{.cost = limit, .left = Box4::empty(), .right = Box4::empty()};
  alignas(16) std::array<float, 4> lower, upper;
  box.lower.store(lower.data());
  box.upper.store(upper.data());
  std::array<SpatialBin, kMaxSpatialBins> bins;
  for (int axis = 0; axis < 3; ++axis) {
    const Planes planes(lower[static_cast<std::size_t>(axis)], upper[static_cast<std::size_t>(axis)], bin_count);
    if (!planes.usable() || !some_plane_fits(refs, axis, planes, bin_count, most_references, cancel)) continue;
    const std::span<SpatialBin> used(bins.data(), bin_count);
    for (SpatialBin& bin : used) bin = {Box4::empty(), 0, 0};
    for_steps(refs.size(), cancel, [&](std::size_t begin, std::size_t end) {
      fill_bins(refs.subspan(begin, end - begin), axis, planes, clipper, used);
    });
    price_planes(used, axis, planes, scale, most_references, best);
  }
  return best;
}

}  // namespace perfect_bvh
