// The order in which rays visit a node's children.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

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

// Checks that every slot is in the order once, the used ones from far to near. The order's distances have three bits
// fewer.
void check_order(const WideNode& node, std::uint32_t count, std::uint32_t octant) {
  std::uint32_t seen = 0;
  float last = __builtin_inff();
  for (std::uint32_t place = 0; place < kWideWidth; ++place) {
    const std::uint32_t lane = node.order[place] >> (3 * octant) & 7u;
    seen |= 1u << lane;
    if (place >= count) {
      ASSERT_EQ(lane, place) << "octant " << octant << ": an unused slot";
      continue;
    }
    const float here = distance(node, lane, octant), step = 0x1p-19f * (std::abs(here) + 0x1p-10f);
    ASSERT_LE(here, last + step) << "octant " << octant << ", place " << place;
    last = here;
  }
  ASSERT_EQ(seen, 0xFFu) << "octant " << octant;
}

TEST(VisitOrder, IsFarToNearForEveryOctant) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 4000; ++trial) {
    const auto count = static_cast<std::uint32_t>(trial) % (kWideWidth + 1);
    WideNode node = random_node(count, trial % 2 == 1, random);
    set_visit_order(node, count);
    for (std::uint32_t octant = 0; octant < 8; ++octant) {
      SCOPED_TRACE(trial);
      check_order(node, count, octant);
      if (HasFatalFailure()) return;
    }
    for (const std::uint32_t order : node.order) ASSERT_EQ(order >> 24, 0u);
  }
}

// Boxes at the ends of the range, whose distances overflow or have no value.
TEST(VisitOrder, HasEverySlotOnceForAnyBoxes) {
  constexpr float kMost = 3.4e38f, kInfinity = __builtin_inff(), kNan = __builtin_nanf("");
  constexpr std::array kSpecial{kMost, -kMost, kInfinity, -kInfinity, kNan, 0.0f, -0.0f, 1e-45f};
  std::mt19937 random(6);
  for (int trial = 0; trial < 4000; ++trial) {
    WideNode node;
    for (auto& planes : node.planes) {
      for (float& plane : planes) plane = kSpecial[random() % kSpecial.size()];
    }
    set_visit_order(node, static_cast<std::uint32_t>(trial) % (kWideWidth + 1));
    for (std::uint32_t octant = 0; octant < 8; ++octant) {
      std::uint32_t seen = 0;
      for (const std::uint32_t order : node.order) seen |= 1u << (order >> (3 * octant) & 7u);
      ASSERT_EQ(seen, 0xFFu) << "trial " << trial << ", octant " << octant;
    }
  }
}

}  // namespace
}  // namespace perfect_bvh::test
