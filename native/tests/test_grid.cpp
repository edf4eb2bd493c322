// The grid on which builders choose their splits: boxes snapped to it, and the choice among few boxes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

#include "builders/agglomerative.h"
#include "builders/grid.h"
#include "builders/morton.h"

namespace perfect_bvh::test {
namespace {

struct IntegerBox {
  std::array<int, 3> lower, upper;

  [[nodiscard]] GridBox grid() const {
    const auto as_float = [](const std::array<int, 3>& v, float sign) {
      return Float4(sign * static_cast<float>(v[0]), sign * static_cast<float>(v[1]), sign * static_cast<float>(v[2]),
                    0);
    };
    return round_to_short(as_float(lower, 1), as_float(upper, -1));
  }
  void grow(const IntegerBox& other) {
    for (std::size_t a = 0; a < 3; ++a) {
      lower[a] = std::min(lower[a], other.lower[a]);
      upper[a] = std::max(upper[a], other.upper[a]);
    }
  }
  [[nodiscard]] double half_area() const {
    const double x = upper[0] - lower[0], y = upper[1] - lower[1], z = upper[2] - lower[2];
    return x * y + y * z + z * x;
  }
};

std::vector<IntegerBox> random_boxes(std::size_t count, std::uint32_t seed, int size = 3000) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> place(0, kGridSteps - size), step(0, size);
  std::vector<IntegerBox> boxes(count);
  for (IntegerBox& box : boxes) {
    for (std::size_t a = 0; a < 3; ++a) {
      box.lower[a] = place(random);
      box.upper[a] = box.lower[a] + step(random);
    }
  }
  return boxes;
}

IntegerBox united(const std::vector<IntegerBox>& boxes, std::uint32_t members) {
  IntegerBox result{{kGridSteps, kGridSteps, kGridSteps}, {0, 0, 0}};
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if ((members >> i) & 1u) result.grow(boxes[i]);
  }
  return result;
}

TEST(Grid, KnowsAreasExtentsAndUnionsExactly) {
  const auto boxes = random_boxes(200, 1, kGridSteps);
  for (std::size_t i = 0; i + 1 < boxes.size(); ++i) {
    EXPECT_EQ(half_area(boxes[i].grid()), boxes[i].half_area());
    IntegerBox both = boxes[i];
    both.grow(boxes[i + 1]);
    EXPECT_EQ(half_area(min(boxes[i].grid(), boxes[i + 1].grid())), both.half_area());
    int longest = 0;
    for (std::size_t a = 0; a < 3; ++a) longest = std::max(longest, both.upper[a] - both.lower[a]);
    EXPECT_EQ(longest_extent(both.grid()), longest);
  }
}

TEST(Grid, SnapsToTheNearestStepAndKeepsPositions) {
  alignas(16) const std::array<float, 8> corners{-10, 20, 5, 0, 30, 40, 6, 0};
  const GridFrame frame = GridFrame::around(Box4::load(corners.data()));
  alignas(16) const std::array<float, 8> inner{0, 30, 5.5f, 0, 10, 40, 5.5f, 0};
  for (const std::uint32_t position : {0u, 65535u, 65536u, 0xDEADBEEFu}) {
    alignas(16) GridRef ref;
    frame.snap(Box4::load(inner.data()), position).store(&ref);
    EXPECT_EQ(ref.position(), position);
    EXPECT_NEAR(ref.lower[0], kGridSteps * 10.0 / 40, 1);  // the longest axis is 40 long
    EXPECT_NEAR(-ref.negated_upper[1], kGridSteps * 20.0 / 40, 1);
    EXPECT_NEAR(ref.lower[2], kGridSteps * 0.5 / 40, 1);
  }
}

TEST(Grid, RefinesItsFrameUntilFloatsHaveNoMoreDetail) {
  alignas(16) const std::array<float, 8> corners{1, 1, 1, 0, 2, 2, 2, 0};
  GridFrame frame = GridFrame::around(Box4::load(corners.data()));
  const GridBox point = IntegerBox{{5, 5, 5}, {5, 5, 5}}.grid();
  int refined = 0;
  for (GridFrame next = frame.around(point); next.steps > frame.steps; next = frame.around(point)) {
    EXPECT_GE(next.steps, frame.steps);
    frame = next;
    ASSERT_LT(++refined, 10);
  }
  EXPECT_GT(refined, 0);
  EXPECT_LE(frame.steps, 0x1p24f);
}

TEST(Grid, BinsAreInRangeAndBordersAreWhereBinsChange) {
  std::mt19937 random(3);
  for (const std::uint32_t bin_count : {2u, 3u, 16u, 255u, 256u}) {
    for (int round = 0; round < 200; ++round) {
      std::uniform_int_distribution<int> any(0, 2 * kGridSteps);
      int low = any(random), high = any(random);
      if (round % 4 == 0) high = low + round / 4;
      if (low > high) std::swap(low, high);
      high = std::min(high, 2 * kGridSteps);
      GridBounds bounds;
      bounds.centroid_lower = Short8(static_cast<std::int16_t>(low));
      bounds.centroid_upper = Short8(static_cast<std::int16_t>(high));
      const BinMap map(bounds, bin_count);
      const auto bin_of = [&](int centroid) { return map(Short8(static_cast<std::int16_t>(centroid))).lane<1>(); };
      ASSERT_EQ(bin_of(low), 0u);
      ASSERT_LT(bin_of(high), bin_count);
      for (std::uint32_t bin = 1; bin <= bin_of(high); ++bin) {
        const int border = map.border(1, bin);
        ASSERT_GE(bin_of(border), bin) << low << " " << high << " " << bin_count;
        ASSERT_LT(bin_of(border - 1), bin);
      }
    }
  }
}

struct Costs {
  double traversal, intersection;
  std::uint32_t max_leaf_size;
};

// Returns the cost of the best of all trees over some boxes, by trying all of them.
double best_tree(const std::vector<IntegerBox>& boxes, std::uint32_t members, const Costs& costs) {
  const auto count = static_cast<std::uint32_t>(__builtin_popcount(members));
  const double area = united(boxes, members).half_area();
  double best = count <= costs.max_leaf_size ? costs.intersection * area * count : 1e300;
  for (std::uint32_t left = (members - 1) & members; left != 0; left = (left - 1) & members) {
    best = std::min(best,
                    costs.traversal * area + best_tree(boxes, left, costs) + best_tree(boxes, members & ~left, costs));
  }
  return best;
}

TEST(FewBoxes, FormTheBestTreeOfAll) {
  for (const Costs costs : {Costs{1, 1, 8}, Costs{1, 0.3, 8}, Costs{0, 1, 8}, Costs{1, 1, 1}, Costs{2, 1, 2}}) {
    BuildConfig config;
    config.traversal_cost = static_cast<float>(costs.traversal);
    config.intersection_cost = static_cast<float>(costs.intersection);
    config.max_leaf_size = costs.max_leaf_size;
    for (std::uint32_t seed = 0; seed < 60; ++seed) {
      const std::uint32_t count = 2 + seed % 3, all = (1u << count) - 1;
      const auto boxes = random_boxes(count, seed, seed % 2 == 0 ? 3000 : 12000);
      std::array<GridBox, kFewBoxes> grid;
      for (std::uint32_t i = 0; i < count; ++i) grid[i] = boxes[i].grid();
      const double area = united(boxes, all).half_area();
      const std::uint32_t left = split_few(grid.data(), count, static_cast<float>(area), config);
      const double chosen =
          left == 0 ? costs.intersection * area * count
                    : costs.traversal * area + best_tree(boxes, left, costs) + best_tree(boxes, all & ~left, costs);
      if (left == 0) {
        EXPECT_LE(count, costs.max_leaf_size);
      }
      EXPECT_LE(chosen, best_tree(boxes, all, costs) * (1 + 1e-5)) << count << " boxes, seed " << seed;
    }
  }
}

TEST(FewBoxes, TakeTheBestPlaneOfUpToEight) {
  BuildConfig config;
  config.traversal_cost = 0;
  for (std::uint32_t seed = 0; seed < 100; ++seed) {
    const std::uint32_t count = 5 + seed % 4, all = (1u << count) - 1;
    const auto boxes = random_boxes(count, seed);
    std::array<GridBox, kFewBoxes> grid;
    for (std::uint32_t i = 0; i < count; ++i) grid[i] = boxes[i].grid();
    const auto cost_of = [&](std::uint32_t left) {
      return united(boxes, left).half_area() * __builtin_popcount(left) +
             united(boxes, all & ~left).half_area() * __builtin_popcount(all & ~left);
    };
    double best = united(boxes, all).half_area() * count;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::uint32_t border = 0; border < count; ++border) {
        std::uint32_t left = 0;
        for (std::uint32_t i = 0; i < count; ++i) {
          if (boxes[i].lower[axis] + boxes[i].upper[axis] < boxes[border].lower[axis] + boxes[border].upper[axis]) {
            left |= 1u << i;
          }
        }
        if (left != 0) best = std::min(best, cost_of(left));
      }
    }
    const float area = static_cast<float>(united(boxes, all).half_area());
    const std::uint32_t left = split_few(grid.data(), count, area, config);
    ASSERT_NE(left, 0u);
    ASSERT_NE(left, all);
    EXPECT_LE(cost_of(left), best * (1 + 1e-5)) << seed;
  }
}

TEST(RadixSort, SortsByTheChosenBitsAndIsStable) {
  std::mt19937_64 random(1);
  CancelToken never;
  for (const std::size_t count : {0u, 1u, 2u, 1000u, 50000u}) {
    for (const auto& [first_bit, bit_count] : {std::pair{32u, 32u}, {0u, 11u}, {20u, 30u}, {40u, 1u}}) {
      std::vector<std::uint64_t> items(count), scratch(count);
      for (auto& item : items) item = random();
      const std::uint64_t mask = (std::uint64_t{1} << bit_count) - 1;
      const unsigned shift = first_bit;
      auto expected = items;
      std::stable_sort(expected.begin(), expected.end(),
                       [=](auto a, auto b) { return ((a >> shift) & mask) < ((b >> shift) & mask); });
      const auto sorted = radix_sort(items, scratch, first_bit, bit_count, never);
      EXPECT_TRUE(std::equal(sorted.begin(), sorted.end(), expected.begin(), expected.end()));
    }
  }
}

TEST(RadixSort, OrdersFloatsAsNumbers) {
  const std::array<float, 9> values{-3e38f, -1.0f, -1e-40f, -0.0f, 0.0f, 1e-40f, 0.5f, 2.0f, 3e38f};
  for (std::size_t i = 0; i + 1 < values.size(); ++i) EXPECT_LT(ordered_bits(values[i]), ordered_bits(values[i + 1]));
}

}  // namespace
}  // namespace perfect_bvh::test
