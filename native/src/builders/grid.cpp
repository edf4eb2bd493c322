#include "builders/grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "builders/bvh2.h"

namespace perfect_bvh {
namespace {

std::array<float, 4> lanes(Float4 v) noexcept {
  alignas(16) std::array<float, 4> result;
  v.store(result.data());
  return result;
}

std::array<std::int16_t, 8> lanes(Short8 v) noexcept {
  alignas(16) std::array<std::int16_t, 8> result;
  v.store(result.data());
  return result;
}

float largest_of_three(const std::array<float, 4>& v) noexcept { return std::max({v[0], v[1], v[2]}); }

}  // namespace

int longest_extent(GridBox box) noexcept {
  const auto negated = lanes(negated_extent(box));
  return -std::min({negated[0], negated[1], negated[2]});
}

int GridBounds::longest_axis() const noexcept {
  const auto spread = lanes(centroid_upper - centroid_lower);
  return static_cast<int>(std::max_element(spread.begin(), spread.begin() + 3) - spread.begin());
}

bool GridBounds::has_spread() const noexcept {
  return lanes(centroid_upper - centroid_lower)[static_cast<std::size_t>(longest_axis())] > 0;
}

GridFrame GridFrame::around(const Box4& box) noexcept {
  const auto lower = lanes(box.lower), upper = lanes(box.upper);
  float largest = 0.0f;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    largest = std::max({largest, std::abs(lower[axis]), std::abs(upper[axis])});
  }
  const int exponent = largest > 0.0f ? std::clamp(-std::ilogb(largest), -126, 127) : 0;
  GridFrame scaled;
  scaled.multiplier = std::ldexp(1.0f, exponent);
  return scaled.around_part(box);
}

GridFrame GridFrame::around_part(const Box4& box) const noexcept {
  GridFrame frame;
  frame.multiplier = multiplier;
  frame.origin = (box.lower * Float4(multiplier)).xyz0();
  const float extent = largest_of_three(lanes((box.upper * Float4(multiplier) - frame.origin).xyz0()));
  constexpr float kLeastExtent = 0x1p-100f;  // smaller boxes count as a point
  frame.steps = extent > kLeastExtent ? static_cast<float>(kGridSteps) / extent : 1.0f;
  return frame;
}

GridFrame GridFrame::around(GridBox box) const noexcept {
  const auto corners = lanes(box);
  const auto from = lanes(origin);
  std::array<float, 4> lower{};
  float largest = 0.0f;
  int extent = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // One more step on each side, to cover rounding.
    const int low = corners[axis] - 1, high = -corners[axis + 4] + 1;
    extent = std::max(extent, high - low);
    lower[axis] = from[axis] + static_cast<float>(low) / steps;
    largest = std::max({largest, std::abs(lower[axis]), std::abs(from[axis] + static_cast<float>(high) / steps)});
  }
  // A grid step smaller than the spacing of floats would resolve nothing more, and would not be exact.
  const float finest = std::ldexp(1.0f, 23) / std::max(largest, std::ldexp(1.0f, -100));
  GridFrame frame = *this;
  frame.steps = std::min(steps * (static_cast<float>(kGridSteps) / static_cast<float>(extent)), finest);
  if (!(frame.steps > steps)) return *this;
  frame.origin = Float4(lower[0], lower[1], lower[2], 0.0f);
  return frame;
}

// Grid bins -----------------------------------------------------------------------------------------------------------

namespace {

using AxisBoxes = std::array<GridBox, 3>;

[[nodiscard]] AxisBoxes empty_boxes() noexcept { return {empty_grid_box(), empty_grid_box(), empty_grid_box()}; }

void grow(AxisBoxes& boxes, const Bin& bin) noexcept {
  for (std::size_t axis = 0; axis < 3; ++axis) boxes[axis] = min(boxes[axis], bin.boxes[axis]);
}

// Returns the costs of counts of references.
template <Counting kCounting>
[[nodiscard]] Float4 weights_of(Float4 counts) noexcept {
  if constexpr (kCounting == Counting::kEach) return counts;
  // Rounds up; no quotient is close to a whole number.
  constexpr auto kUsual = static_cast<float>(LeafLimit::kUsual);
  return to_float(truncate((counts + Float4(kUsual - 0.5f)) * Float4(1.0f / kUsual)));
}

}  // namespace

BinMap::BinMap(const GridBounds& bounds, std::uint32_t bin_count) noexcept : lower_(bounds.centroid_lower) {
  const Float4 places = lanes_to_float(bounds.centroid_upper - bounds.centroid_lower) + Float4(1.0f);
  // 2 * (places - 1) * scale / 65536 < bin_count: the factor, slightly less than 1, covers the rounding of the
  // division. The limit matters if there are fewer positions than bins.
  constexpr float kSlightlyLess = 1.0f - 0x1p-22f;
  const Float4 scale = Float4(static_cast<float>(bin_count) * 32768.0f * kSlightlyLess) / places;
  scale_ = to_unsigned_lanes(truncate(min(scale, Float4(65535.0f))));
}

std::int32_t BinMap::border(std::uint32_t axis, std::uint32_t bin) const noexcept {
  alignas(16) std::array<std::int16_t, 8> lower;
  alignas(16) std::array<std::uint16_t, 8> scale;
  lower_.store(lower.data());
  scale_.store(scale.data());
  return lower[axis] + static_cast<std::int32_t>((bin * 32768u + scale[axis] - 1u) / scale[axis]);
}

GridBins::GridBins(std::uint32_t bin_count) noexcept : size_(bin_count) {
  std::fill_n(rows_.begin(), size_, Bin{empty_boxes(), {}});
}

template <int Axis>
void GridBins::add_one(Short8 bin, GridBox box) noexcept {
  Bin& row = rows_[bin.lane<Axis>()];
  row.boxes[Axis] = min(row.boxes[Axis], box);
  ++row.counts[Axis];
}

template <int Axis>
void GridBins::add_axis(const GridRef* refs, std::size_t count, std::size_t stride, const BinMap& map) noexcept {
  for (std::size_t i = 0; i < count; i += stride) {
    const GridBox box = Short8::load(&refs[i]);
    add_one<Axis>(map(doubled_centroid(box)), box);
  }
}

void GridBins::add(const GridRef* refs, std::size_t count, std::size_t stride, const BinMap& map,
                   int only_axis) noexcept {
  switch (only_axis) {
    case 0:
      return add_axis<0>(refs, count, stride, map);
    case 1:
      return add_axis<1>(refs, count, stride, map);
    case 2:
      return add_axis<2>(refs, count, stride, map);
    default:
      for (std::size_t i = 0; i < count; i += stride) {
        const GridBox box = Short8::load(&refs[i]);
        const Short8 bin = map(doubled_centroid(box));
        add_one<0>(bin, box);
        add_one<1>(bin, box);
        add_one<2>(bin, box);
      }
  }
}

// Handles the three axes at once: one sweep from the right for the costs there, one from the left to price each plane.
template <Counting kCounting>
Plane GridBins::find_best_counting(std::uint32_t count, int only_axis) const noexcept {
  std::array<Float4, kMaxBins> right_counts, right_costs;
  AxisBoxes boxes = empty_boxes();
  Int4 right_count(0);
  for (std::uint32_t i = size_ - 1; i > 0; --i) {
    const Bin& bin = rows_[i];
    grow(boxes, bin);
    // Lane by lane: a wide load would have to wait for the preceding narrow stores.
    right_count = right_count + Int4(bin.counts[0], bin.counts[1], bin.counts[2], 0);
    right_counts[i] = to_float(right_count);
    right_costs[i] = half_areas(boxes) * weights_of<kCounting>(right_counts[i]);
  }
  grow(boxes, rows_[0]);
  const Float4 all(static_cast<float>(count)), one(1.0f);
  // A plane that is cheaper than all references on one side has some on both. Leaf counts are too coarse for that test.
  const Float4 never(std::numeric_limits<float>::max());
  Float4 best_cost = kCounting == Counting::kEach ? half_areas(boxes) * all : never, best_bin(0.0f), bin(0.0f);
  boxes = empty_boxes();
  for (std::uint32_t i = 1; i < size_; ++i) {
    grow(boxes, rows_[i - 1]);
    bin = bin + one;
    const Float4 left_counts = all - right_counts[i];
    Float4 cost = half_areas(boxes) * weights_of<kCounting>(left_counts) + right_costs[i];
    if constexpr (kCounting == Counting::kLeaves) {
      cost = select_less(min(left_counts, right_counts[i]), one, never, cost);
    }
    best_bin = select_less(cost, best_cost, bin, best_bin);
    best_cost = min(cost, best_cost);
  }
  alignas(16) std::array<float, 4> costs, bins;
  best_cost.store(costs.data());
  best_bin.store(bins.data());
  const auto cheapest = std::min_element(costs.begin(), costs.begin() + 3) - costs.begin();
  const auto axis = static_cast<std::uint32_t>(only_axis < 0 ? static_cast<int>(cheapest) : only_axis);
  return {costs[axis], axis, static_cast<std::uint32_t>(bins[axis])};
}

Plane GridBins::find_best(std::uint32_t count, int only_axis, Counting counting) const noexcept {
  return counting == Counting::kEach ? find_best_counting<Counting::kEach>(count, only_axis)
                                     : find_best_counting<Counting::kLeaves>(count, only_axis);
}

}  // namespace perfect_bvh
