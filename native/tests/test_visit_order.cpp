// The order in which rays visit a node's children, compared with sorting them one by one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include "wide/collapse.h"

namespace perfect_bvh::test {
namespace {

WideNode random_node(std::uint32_t count, bool has_equals, std::mt19937& random) {
  std::uniform_real_distribution<float> anywhere(-10.0f, 10.0f);
  WideNode node;
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
    for (int axis = 0; axis < 3; ++axis) {
      float a = anywhere(random), b = anywhere(random);
      if (has_equals) a = std::round(0.1f * a), b = a;  // -1, 0 or 1, and both zeros
      const bool is_taken = lane < count;
      node.planes[2 * axis][lane] = is_taken ? std::min(a, b) : __builtin_inff();
      node.planes[2 * axis + 1][lane] = is_taken ? std::max(a, b) : -__builtin_inff();
    }
  }
  return node;
}

// The distance along the diagonal of the octant's rays; 1, 2 and 4 point down one axis.
float distance(const WideNode& node, std::uint32_t lane, std::uint32_t octant) {
  const auto centre = [&](int axis) {
    const float value = node.planes[2 * axis][lane] * 0.5f + node.planes[2 * axis + 1][lane] * 0.5f;
    return (octant >> axis & 1) != 0 ? -value : value;
  };
  return centre(0) + centre(1) + centre(2);
}

std::vector<std::uint32_t> expected_order(const WideNode& node, std::uint32_t count, std::uint32_t octant) {
  const bool is_opposite = octant != 0 && octant != 1 && octant != 2 && octant != 4;
  const std::uint32_t sorted_by = is_opposite ? 7 - octant : octant;
  std::vector<std::uint32_t> lanes(kWideWidth);
  std::iota(lanes.begin(), lanes.end(), 0u);
  const auto end = lanes.begin() + count;
  std::stable_sort(lanes.begin(), end, [&](std::uint32_t a, std::uint32_t b) {
    return distance(node, a, sorted_by) > distance(node, b, sorted_by);
  });
  if (is_opposite) std::reverse(lanes.begin(), end);
  return lanes;
}

TEST(VisitOrder, IsFarToNearForEveryOctant) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 4000; ++trial) {
    const auto count = static_cast<std::uint32_t>(trial) % (kWideWidth + 1);
    WideNode node = random_node(count, trial % 2 == 1, random);
    set_visit_order(node, count);
    for (std::uint32_t octant = 0; octant < 8; ++octant) {
      std::vector<std::uint32_t> lanes;
      for (const std::uint32_t order : node.order) lanes.push_back(order >> (3 * octant) & 7u);
      ASSERT_EQ(lanes, expected_order(node, count, octant)) << "trial " << trial << ", octant " << octant;
    }
    for (const std::uint32_t order : node.order) ASSERT_EQ(order >> 24, 0u);
  }
}

}  // namespace
}  // namespace perfect_bvh::test
