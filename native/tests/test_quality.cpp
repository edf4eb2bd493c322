// The measures of a tree's quality, compared with hand-counted cases and with slow, simple implementations.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "builders/builder.h"
#include "builders/quality.h"
#include "tests/box_sets.h"
#include "tests/thread_counts.h"

namespace perfect_bvh::test {
namespace {

using Triangles = std::vector<Vec3<std::uint32_t>>;

// Two leaves of one triangle each.
Bvh2 two_leaves(const Aabb& left, const Aabb& right) {
  Aabb root = left;
  root.grow(right);
  Bvh2 tree;
  tree.nodes = {{root.lower, 2, root.upper, 0}, {}, {left.lower, 0, left.upper, 1}, {right.lower, 1, right.upper, 1}};
  tree.prim_indices = {0, 1};
  tree.depth = 1;
  return tree;
}

double epo(const Bvh2& tree, const std::vector<Vec3f>& positions, const Triangles& triangles, int thread_count = 1) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  return measure_epo(tree, positions, triangles, pool, cancel);
}

double variability(const Bvh2& tree, std::uint32_t line_count, int thread_count = 1) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  return measure_leaf_count_variability(tree, line_count, pool, cancel);
}

TEST(Epo, CountsWhatLiesInTheOthersBox) {
  // Each triangle has an area of 2, and a quarter of it is in the other's box.
  const std::vector<Vec3f> positions{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {3, 2, 0}, {1, 2, 0}, {3, 0, 0}};
  const Triangles triangles{{0, 1, 2}, {3, 4, 5}};
  const Bvh2 tree = two_leaves({{0, 0, 0}, {2, 2, 0}}, {{1, 0, 0}, {3, 2, 0}});
  EXPECT_NEAR(epo(tree, positions, triangles), (0.5 + 0.5) / 4, 1e-12);
}

TEST(Epo, IsZeroForSeparateBoxesAndForNothing) {
  const std::vector<Vec3f> positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {3, 0, 0}, {4, 0, 0}, {3, 1, 0}};
  const Triangles triangles{{0, 1, 2}, {3, 4, 5}};
  EXPECT_EQ(epo(two_leaves({{0, 0, 0}, {1, 1, 0}}, {{3, 0, 0}, {4, 1, 0}}), positions, triangles), 0.0);
  EXPECT_EQ(epo({}, {}, {}), 0.0);
}

struct Soup {
  std::vector<Vec3f> positions;
  Triangles triangles;
  Bvh2 tree;

  Soup(std::size_t count, float size) {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> place(-1.0f, 1.0f), step(-size, size);
    std::vector<PrimRef> refs;
    for (std::size_t i = 0; i < count; ++i) {
      const Vec3f centre{place(random), place(random), place(random)};
      Aabb box;
      for (int corner = 0; corner < 3; ++corner) {
        positions.push_back(centre + Vec3f{step(random), step(random), step(random)});
        box.grow(positions.back());
      }
      const auto first = static_cast<std::uint32_t>(3 * i);
      triangles.push_back({first, first + 1, first + 2});
      refs.push_back(make_ref(box.lower, box.upper, i));
    }
    ThreadPool pool(1);
    CancelToken cancel;
    tree = build_bvh2(refs, {}, pool, cancel);
  }
};

bool is_below(const Bvh2& tree, std::size_t index, std::uint32_t prim) {
  const Bvh2Node& node = tree.nodes[index];
  if (!node.is_leaf()) return is_below(tree, node.first, prim) || is_below(tree, node.first + 1, prim);
  const auto first = tree.prim_indices.begin() + node.first;
  return std::find(first, first + node.count, prim) != first + node.count;
}

// Returns the share of a triangle inside a box, from many points spread evenly over it.
double share_inside(const Soup& soup, std::size_t triangle, const Aabb& box, int steps) {
  const auto t = soup.triangles[triangle];
  int inside = 0, all = 0;
  for (int i = 0; i < steps; ++i) {
    for (int j = 0; j < steps - i; ++j) {
      const float u = (static_cast<float>(i) + 0.33f) / static_cast<float>(steps);
      const float v = (static_cast<float>(j) + 0.33f) / static_cast<float>(steps);
      const Vec3f point = soup.positions[t.x] * (1 - u - v) + soup.positions[t.y] * u + soup.positions[t.z] * v;
      inside += box.contains({point, point});
      ++all;
    }
  }
  return static_cast<double>(inside) / all;
}

TEST(Epo, AgreesWithCountingPointsInBoxes) {
  const Soup soup(60, 0.5f);
  double cost = 0, area = 0;
  for (std::size_t i = 0; i < soup.triangles.size(); ++i) {
    const auto t = soup.triangles[i];
    const Vec3d a = to_double(soup.positions[t.x]);
    const double own = 0.5 * length(cross(to_double(soup.positions[t.y]) - a, to_double(soup.positions[t.z]) - a));
    area += own;
    for (std::size_t n = 0; n < soup.tree.nodes.size(); ++n) {
      if (n == 1 || is_below(soup.tree, n, static_cast<std::uint32_t>(i))) continue;
      const Bvh2Node& node = soup.tree.nodes[n];
      cost += own * share_inside(soup, i, node.box(), 60) * (node.is_leaf() ? node.count : 1);
    }
  }
  ASSERT_GT(cost / area, 1.0) << "the soup is too thin to test anything";
  EXPECT_NEAR(epo(soup.tree, soup.positions, soup.triangles), cost / area, 0.01 * cost / area);
}

TEST(Epo, IsTheSameForAnyThreadCount) {
  const Soup soup(5000, 0.1f);
  const double alone = epo(soup.tree, soup.positions, soup.triangles, 1);
  for (int thread_count : thread_counts())
    EXPECT_EQ(epo(soup.tree, soup.positions, soup.triangles, thread_count), alone);
}

TEST(LeafCountVariability, IsZeroWhereEveryLineMeetsAllLeaves) {
  EXPECT_EQ(variability(two_leaves({{0, 0, 0}, {1, 1, 1}}, {{0, 0, 0}, {1, 1, 1}}), 1000), 0.0);
  EXPECT_EQ(variability({}, 1000), 0.0);
}

TEST(LeafCountVariability, MatchesTheChancesOfTwoHalves) {
  // A cube of half area 3 cut in two: a line meets each half with a chance of 2/3, and hence both with 1/3.
  const double deviation = std::sqrt(1.0 / 3 - 1.0 / 9);
  EXPECT_NEAR(variability(two_leaves({{0, 0, 0}, {0.5, 1, 1}}, {{0.5, 0, 0}, {1, 1, 1}}), 200000), deviation, 0.005);
}

TEST(LeafCountVariability, IsTheSameForAnyThreadCount) {
  const Soup soup(2000, 0.1f);
  const double alone = variability(soup.tree, 5000, 1);
  EXPECT_GT(alone, 0.0);
  for (int thread_count : thread_counts()) EXPECT_EQ(variability(soup.tree, 5000, thread_count), alone);
}

TEST(Quality, MeasuresOverlapAndDuplication) {
  const Bvh2 apart = two_leaves({{0, 0, 0}, {1, 1, 1}}, {{2, 0, 0}, {3, 1, 1}});
  EXPECT_EQ(measure_quality(apart).sibling_overlap, 0.0);
  Bvh2 crossing = two_leaves({{0, 0, 0}, {2, 1, 1}}, {{1, 0, 0}, {3, 1, 1}});
  EXPECT_DOUBLE_EQ(measure_quality(crossing).sibling_overlap, 3.0 / 7.0);
  EXPECT_EQ(measure_quality(crossing).primitive_count, 2u);
  crossing.prim_indices = {0, 0};
  crossing.refittable = false;
  EXPECT_EQ(measure_quality(crossing).primitive_count, 1u);
  EXPECT_EQ(measure_quality(crossing).reference_count, 2u);
}

}  // namespace
}  // namespace perfect_bvh::test
