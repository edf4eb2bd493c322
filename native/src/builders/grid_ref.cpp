#include "builders/grid_ref.h"

#include <algorithm>
#include <array>
#include <cmath>

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
  constexpr float kLeastExtent = 0x1p-100f;  // what is smaller yet is a point
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
    // A step more on each side, for what was lost by rounding.
    const int low = corners[axis] - 1, high = -corners[axis + 4] + 1;
    extent = std::max(extent, high - low);
    lower[axis] = from[axis] + static_cast<float>(low) / steps;
    largest = std::max({largest, std::abs(lower[axis]), std::abs(from[axis] + static_cast<float>(high) / steps)});
  }
  // A grid step smaller than the spacing of floats would tell nothing apart, and would not be exact.
  const float finest = std::ldexp(1.0f, 23) / std::max(largest, std::ldexp(1.0f, -100));
  GridFrame frame = *this;
  frame.steps = std::min(steps * (static_cast<float>(kGridSteps) / static_cast<float>(extent)), finest);
  if (!(frame.steps > steps)) return *this;
  frame.origin = Float4(lower[0], lower[1], lower[2], 0.0f);
  return frame;
}

}  // namespace perfect_bvh
