#include "builders/sweep_subtree.h"

#include <algorithm>

#include "builders/agglomerative.h"

namespace perfect_bvh {
namespace {

constexpr std::uint32_t kFewestBoxes = 4;  // up to this many, every way to halve them is tried, not only planes

}  // namespace

SweepSubtree::SweepSubtree(std::span<const PrimRef> prims, const BuildConfig& config, const SweepRange& range,
                           const Orders& orders, std::uint16_t* number_of)
    : prims_(prims),
      config_(config),
      begin_(range.begin),
      refs_(range.count),
      scratch_(range.count),
      is_left_(range.count),
      right_costs_(range.count) {
  for (std::uint32_t i = 0; i < range.count; ++i) {
    refs_[i] = orders[0][i];
    number_of[refs_[i].position()] = static_cast<Number>(i);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    orders_[axis].resize(range.count);
    for (std::uint32_t i = 0; i < range.count; ++i) orders_[axis][i] = number_of[orders[axis][i].position()];
  }
}

bool SweepSubtree::split(SweepRange& range, SweepRange& left, SweepRange& right) {
  if (range.count == 1) return false;
  GridBox box = measure(range);
  if (longest_extent(box) < kCoarseSteps) {
    const GridFrame frame = range.frame.around(box);
    if (frame.steps != range.frame.steps) {
      range.frame = frame;
      box = snap(range);
    }
  }
  const auto area = static_cast<float>(half_area(box));
  std::uint32_t left_count = 0;
  if (area > 0.0f && depth_allows_any_split(range)) {
    left_count = range.count <= kFewestBoxes ? divide_few(range, area) : divide_at_plane(range, area);
  }
  if (left_count == 0) {
    if (range.count <= config_.max_leaf_size) return false;
    left_count = divide_in_halves(range);
  }
  left.frame = right.frame = range.frame;
  divide_rows(range, left_count, left, right);
  return true;
}

Box4 SweepSubtree::write_leaf(const SweepRange& range, std::uint32_t* prim_indices) const noexcept {
  const Number* numbers = order(range, 0);
  Box4 box = Box4::empty();
  for (std::uint32_t i = 0; i < range.count; ++i) {
    const PrimRef& prim = prims_[refs_[numbers[i]].position()];
    prim_indices[i] = prim.prim_index;
    box.grow(Box4::load(&prim));
  }
  const Float4 zero(0.0f);  // -0 + 0 is +0
  return {box.lower + zero, box.upper + zero};
}

GridBox SweepSubtree::measure(const SweepRange& range) const noexcept {
  const Number* numbers = order(range, 0);
  GridBox box = empty_grid_box();
  for (std::uint32_t i = 0; i < range.count; ++i) box = min(box, Short8::load(&refs_[numbers[i]]));
  return box;
}

GridBox SweepSubtree::snap(const SweepRange& range) noexcept {
  const Number* numbers = order(range, 0);
  GridBox box = empty_grid_box();
  for (std::uint32_t i = 0; i < range.count; ++i) {
    GridRef& ref = refs_[numbers[i]];
    const std::uint32_t position = ref.position();
    const GridBox snapped = range.frame.snap(Box4::load(&prims_[position]), position);
    snapped.store(&ref);
    box = min(box, snapped);
  }
  return box;
}

// Below this node, only the first order is used.
std::uint32_t SweepSubtree::divide_few(const SweepRange& range, float area) noexcept {
  Number* numbers = order(range, 0);
  std::array<GridBox, kFewBoxes> boxes;
  for (std::uint32_t i = 0; i < range.count; ++i) boxes[i] = Short8::load(&refs_[numbers[i]]);
  const std::uint32_t is_left = split_few(boxes.data(), range.count, area, config_);
  if (is_left == 0) return 0;
  std::array<Number, kFewestBoxes> old;
  std::copy_n(numbers, range.count, old.begin());
  std::uint32_t left_count = 0;
  for (std::uint32_t i = 0; i < range.count; ++i) left_count += (is_left >> i) & 1u;
  std::array<Number*, 2> to{numbers + left_count, numbers};
  for (std::uint32_t i = 0; i < range.count; ++i) *to[(is_left >> i) & 1u]++ = old[i];
  return left_count;
}

// Handles the three axes at once: one sweep from the right for the costs there, one from the left to price each plane.
std::uint32_t SweepSubtree::divide_at_plane(const SweepRange& range, float area) noexcept {
  const std::array<const Number*, 3> orders{order(range, 0), order(range, 1), order(range, 2)};
  std::array<GridBox, 3> boxes;
  const auto grow = [&](std::uint32_t rank) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      boxes[axis] = min(boxes[axis], Short8::load(&refs_[orders[axis][rank]]));
    }
  };
  boxes.fill(empty_grid_box());
  const Float4 one(1.0f);
  Float4 count(0.0f);
  for (std::uint32_t i = range.count - 1; i > 0; --i) {
    grow(i);
    count = count + one;
    right_costs_[i] = half_areas(boxes) * count;
  }
  boxes.fill(empty_grid_box());
  const auto all = static_cast<float>(range.count);
  Float4 best_cost(area * all), best_count(0.0f);
  count = Float4(0.0f);
  for (std::uint32_t i = 1; i < range.count; ++i) {
    grow(i - 1);
    count = count + one;
    const Float4 cost = half_areas(boxes) * count + right_costs_[i];
    best_count = select_less(cost, best_cost, count, best_count);
    best_cost = min(cost, best_cost);
  }
  alignas(16) std::array<float, 4> costs, counts;
  best_cost.store(costs.data());
  best_count.store(counts.data());
  const auto axis = static_cast<std::size_t>(std::min_element(costs.begin(), costs.begin() + 3) - costs.begin());
  const auto left_count = static_cast<std::uint32_t>(counts[axis]);
  if (left_count == 0) return 0;
  const float split_cost = config_.traversal_cost * area + config_.intersection_cost * costs[axis];
  if (range.count <= config_.max_leaf_size && !(split_cost < config_.intersection_cost * area * all)) return 0;
  divide_at(range, axis, left_count);
  return left_count;
}

// Used if the SAH decides nothing (no area, no plane gains anything) or the maximum depth is near: splits in the middle
// of an order.
std::uint32_t SweepSubtree::divide_in_halves(const SweepRange& range) noexcept {
  if (range.count <= kFewestBoxes) return range.count / 2;
  GridBounds bounds;
  for (std::uint32_t i = 0; i < range.count; ++i) bounds.grow(Short8::load(&refs_[order(range, 0)[i]]));
  const std::uint32_t left_count = range.count / 2;
  divide_at(range, static_cast<std::size_t>(bounds.longest_axis()), left_count);
  return left_count;
}

// Rearranges the other two orders: left side first, both sides keep their order.
void SweepSubtree::divide_at(const SweepRange& range, std::size_t split_axis, std::uint32_t left_count) noexcept {
  const Number* split_order = order(range, split_axis);
  for (std::uint32_t i = 0; i < range.count; ++i) is_left_[split_order[i]] = i < left_count;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (axis == split_axis) continue;
    Number* left = order(range, axis);
    const Number* const numbers = left;
    Number* right = scratch_.data();
    for (std::uint32_t i = 0; i < range.count; ++i) {
      const Number number = numbers[i];
      const std::uint8_t is_left = is_left_[number];
      *left = number;
      *right = number;
      left += is_left;
      right += 1 - is_left;
    }
    std::copy(scratch_.data(), right, left);
  }
}

}  // namespace perfect_bvh
