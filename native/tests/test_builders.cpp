// Every builder on every set of boxes: the tree is sound, its leaves are as small as requested, its bytes are the same
// for any number of threads, and building can be stopped.
#include <gtest/gtest.h>

#include <algorithm>

#include "builders/builder.h"
#include "builders/morton.h"
#include "builders/quality.h"
#include "core/errors.h"
#include "tests/box_sets.h"
#include "tests/same_bytes.h"
#include "tests/thread_counts.h"
#include "tests/tree_faults.h"

namespace perfect_bvh::test {
namespace {

Bvh2 build(const std::vector<PrimRef>& refs, const BuildConfig& config, int thread_count = 1) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  return build_bvh2(refs, config, pool, cancel);
}

struct Case {
  const char* name;
  BuildConfig config;
};

std::ostream& operator<<(std::ostream& out, const Case& value) { return out << value.name; }

BuildConfig config_of(BuilderKind kind) {
  BuildConfig config;
  config.builder = kind;
  return config;
}

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const auto& [kind, name] : kBuilders) {
    if (kind != BuilderKind::kSpatial) all.push_back({name, config_of(kind)});  // adds references: test_spatial.cpp
  }
  BuildConfig config = config_of(BuilderKind::kBinned);
  config.bins = 2, config.axes = 1;
  all.push_back({"binned_two_bins_one_axis", config});
  config.bins = 256, config.axes = 3, config.max_leaf_size = 1;
  all.push_back({"binned_256_bins_single_leaves", config});
  config.bins = 16, config.max_leaf_size = 255, config.traversal_cost = 100.0f;
  all.push_back({"binned_large_leaves", config});
  config = config_of(BuilderKind::kSweep);
  config.max_leaf_size = 1;
  all.push_back({"sweep_single_leaves", config});
  config = config_of(BuilderKind::kBinned);
  config.optimize_passes = 3;
  all.push_back({"binned_optimized", config});
  config = config_of(BuilderKind::kFast);
  config.max_leaf_size = 1;
  all.push_back({"fast_single_leaves", config});
  config.bins = 2, config.axes = 1, config.max_leaf_size = 255, config.traversal_cost = 100.0f;
  all.push_back({"fast_large_leaves", config});
  config = config_of(BuilderKind::kMedian);
  config.max_leaf_size = 1;
  all.push_back({"median_single_leaves", config});
  return all;
}

class Builders : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(All, Builders, testing::ValuesIn(cases()), [](const auto& param) { return param.param.name; });

TEST_P(Builders, MakeSoundTreesOfHardInput) {
  for (const NamedSet& set : hard_sets()) {
    const Bvh2 tree = build(set.refs, GetParam().config);
    EXPECT_EQ(find_fault(tree, set.refs.size()), "") << set.name;
    EXPECT_LE(measure_quality(tree).max_leaf_size, GetParam().config.max_leaf_size) << set.name;
  }
}

TEST_P(Builders, BoundLeavesTightly) {
  const auto refs = sheet(60);
  const Bvh2 tree = build(refs, GetParam().config);
  for (const Bvh2Node& node : tree.nodes) {
    if (!node.is_leaf()) continue;
    Aabb box;
    for (std::uint32_t i = 0; i < node.count; ++i) box.grow(refs[tree.prim_indices[node.first + i]].box());
    EXPECT_EQ(box.lower, node.lower);
    EXPECT_EQ(box.upper, node.upper);
  }
}

TEST_P(Builders, GiveTheSameBytesForAnyThreadCount) {
  const std::vector<NamedSet> sets{{"sheet", sheet(190)},  // large enough that threads share single nodes
                                   {"duplicates", repeated(70000, {1, 2, 3}, {2, 3, 4})},
                                   {"cornered", cornered(10000)},
                                   {"ground and pebbles", ground_and_pebbles(20000)},
                                   {"zeros of both signs", with_zeros_of_both_signs(20000)}};
  for (const NamedSet& set : sets) {
    const Bvh2 alone = build(set.refs, GetParam().config, 1);
    for (int thread_count : thread_counts()) {
      EXPECT_TRUE(same_bytes(alone, build(set.refs, GetParam().config, thread_count)))
          << set.name << " " << thread_count;
    }
  }
}

TEST_P(Builders, MakeNothingOfNothing) {
  const Bvh2 tree = build({}, GetParam().config);
  EXPECT_TRUE(tree.empty());
  EXPECT_EQ(tree.depth, 0u);
  EXPECT_EQ(find_fault(tree, 0), "");
}

TEST_P(Builders, NumberPrimitivesAsTheCallerDoes) {
  auto refs = scattered(3000);
  for (PrimRef& ref : refs) ref.prim_index = 2999 - ref.prim_index;
  const Bvh2 tree = build(refs, GetParam().config);
  EXPECT_EQ(find_fault(tree, refs.size()), "");
  for (const Bvh2Node& node : tree.nodes) {
    for (std::uint32_t i = 0; i < node.count; ++i) {
      EXPECT_TRUE(node.box().contains(refs[2999 - tree.prim_indices[node.first + i]].box()));
    }
  }
}

TEST_P(Builders, StopWhenAsked) {
  const auto refs = sheet(150);
  for (int thread_count : {1, 3}) {
    ThreadPool pool(thread_count);
    CancelToken stopped;
    stopped.request_stop();
    EXPECT_THROW((void)build_bvh2(refs, GetParam().config, pool, stopped), Cancelled);
    CancelToken fresh;
    EXPECT_EQ(find_fault(build_bvh2(refs, GetParam().config, pool, fresh), refs.size()), "")
        << "after a cancelled build";
  }
}

TEST_P(Builders, CountTheirWork) {
  const auto refs = sheet(100);
  for (int thread_count : {1, 3}) {
    ThreadPool pool(thread_count);
    CancelToken cancel;
    cancel.expect(refs.size());
    (void)build_bvh2(refs, GetParam().config, pool, cancel);
    EXPECT_EQ(cancel.fraction(), 1.0f);
    cancel.expect(refs.size() + 1);
    (void)build_bvh2(refs, GetParam().config, pool, cancel);
    EXPECT_LT(cancel.fraction(), 1.0f) << "counted more than its primitives";
  }
}

TEST(BuildConfigTest, IsCheckedAndTheSettingNamed) {
  const auto refs = scattered(10);
  const auto message_of = [&](const BuildConfig& config) -> std::string {
    try {
      (void)build(refs, config);
    } catch (const InvalidArgument& error) {
      return error.what();
    }
    return "";
  };
  BuildConfig config;
  config.bins = 1;
  EXPECT_NE(message_of(config).find("bins"), std::string::npos);
  config = {}, config.bins = 257;
  EXPECT_NE(message_of(config).find("257"), std::string::npos);
  config = {}, config.axes = 2;
  EXPECT_NE(message_of(config).find("axes"), std::string::npos);
  config = {}, config.max_leaf_size = 0;
  EXPECT_NE(message_of(config).find("max_leaf_size"), std::string::npos);
  config = {}, config.intersection_cost = std::nanf("");
  EXPECT_NE(message_of(config).find("intersection_cost"), std::string::npos);
  config = {}, config.traversal_cost = -1.0f;
  EXPECT_NE(message_of(config).find("traversal_cost"), std::string::npos);
}

TEST(Binned, SplitsOnlyWhereItPays) {
  // Two distant clusters: one split between them, and none inside, where all boxes are equal.
  auto refs = repeated(4, {0, 0, 0}, {1, 1, 1});
  for (std::size_t i = 4; i < 8; ++i) refs.push_back(make_ref({9, 0, 0}, {10, 1, 1}, i));
  const Bvh2 tree = build(refs, config_of(BuilderKind::kBinned));
  EXPECT_EQ(measure_quality(tree).leaf_count, 2u);
  // Equal boxes at one place: a split would cost a node and gain nothing.
  EXPECT_EQ(measure_quality(build(repeated(8, {0, 0, 0}, {1, 1, 1}), config_of(BuilderKind::kBinned))).leaf_count, 1u);
}

TEST(Binned, CostsLessWithAllAxesAndMoreBins) {
  const auto refs = ground_and_pebbles(20000);
  const auto sah = [&](std::uint32_t bins, std::uint32_t axes) {
    BuildConfig config = config_of(BuilderKind::kBinned);
    config.bins = bins, config.axes = axes;
    return measure_quality(build(refs, config)).sah;
  };
  EXPECT_LT(sah(32, 3), sah(4, 3));
  EXPECT_LE(sah(16, 3), sah(16, 1) * 1.02);
}

// Returns the SAH of the best plane that separates sorted centroids, in double precision.
double best_plane_cost(const std::vector<PrimRef>& refs) {
  double best = 1e300;
  for (int axis = 0; axis < 3; ++axis) {
    auto sorted = refs;
    std::sort(sorted.begin(), sorted.end(), [axis](const PrimRef& a, const PrimRef& b) {
      return a.lower[axis] + a.upper[axis] < b.lower[axis] + b.upper[axis];
    });
    for (std::size_t split = 1; split < sorted.size(); ++split) {
      Aabb left, right;
      for (std::size_t i = 0; i < sorted.size(); ++i) (i < split ? left : right).grow(sorted[i].box());
      const auto count = static_cast<double>(sorted.size());
      best = std::min(best, static_cast<double>(left.half_area()) * static_cast<double>(split) +
                                static_cast<double>(right.half_area()) * (count - static_cast<double>(split)));
    }
  }
  return best;
}

std::size_t count_below(const Bvh2& tree, std::size_t index) {
  const Bvh2Node& node = tree.nodes[index];
  return node.is_leaf() ? node.count : count_below(tree, node.first) + count_below(tree, node.first + 1);
}

TEST(Sweep, TakesTheBestPlaneOfAll) {
  for (const std::uint32_t seed : {1u, 2u, 3u, 4u}) {
    auto refs = scattered(300, seed);
    refs.push_back(make_ref({-3, -3, -0.1f}, {3, 3, 0}, refs.size()));
    const Bvh2 tree = build(refs, config_of(BuilderKind::kSweep));
    double cost = 0;
    for (const std::size_t child : {tree.nodes[0].first, tree.nodes[0].first + 1}) {
      cost += static_cast<double>(tree.nodes[child].box().half_area()) * static_cast<double>(count_below(tree, child));
    }
    // Planes are compared on a grid of 16384 steps: the chosen one may be worse by the rounding of the boxes' sides.
    EXPECT_NEAR(cost, best_plane_cost(refs), best_plane_cost(refs) * 5e-4) << seed;
  }
}

TEST(Sweep, CostsNoMoreThanBinnedAndLessThanMedian) {
  for (const auto& refs : {sheet(100), scattered(20000), ground_and_pebbles(20000)}) {
    const double sweep = measure_quality(build(refs, config_of(BuilderKind::kSweep))).sah;
    EXPECT_LE(sweep, measure_quality(build(refs, config_of(BuilderKind::kBinned))).sah * 1.01);
    BuildConfig median = config_of(BuilderKind::kMedian);
    median.max_leaf_size = 2;
    EXPECT_LT(sweep, measure_quality(build(refs, median)).sah);
  }
}

TEST(Fast, CostsLittleMoreThanBinnedAndLessThanMedian) {
  for (const auto& refs : {sheet(100), scattered(20000), ground_and_pebbles(20000)}) {
    const double fast = measure_quality(build(refs, config_of(BuilderKind::kFast))).sah;
    EXPECT_LE(fast, measure_quality(build(refs, config_of(BuilderKind::kBinned))).sah * 1.15);
    BuildConfig median = config_of(BuilderKind::kMedian);
    median.max_leaf_size = 2;
    EXPECT_LT(fast, measure_quality(build(refs, median)).sah);
  }
}

TEST(Fast, SplitsOnlyWhereItPays) {
  const auto refs = repeated(200, {0, 0, 0}, {1, 1, 1});
  BuildConfig config = config_of(BuilderKind::kFast);
  EXPECT_EQ(measure_quality(build({refs.begin(), refs.begin() + 8}, config)).leaf_count, 1u);
  config.max_leaf_size = 255;
  EXPECT_EQ(measure_quality(build(refs, config)).leaf_count, 1u) << "large leaves";
}

TEST(Morton, CodesInterleaveTheAxes) {
  alignas(16) std::array<std::int32_t, 4> spread;
  spread_bits(Int4(0b1011, 1023, 0, 1)).store(spread.data());
  EXPECT_EQ(spread, (std::array<std::int32_t, 4>{0b001'000'001'001, 0x09249249, 0, 1}));
  Box4 centers = Box4::empty();
  centers.grow(Float4(0, 0, 0, 0));
  centers.grow(Float4(1024, 1024, 512, 0));
  const MortonGrid grid(centers);
  EXPECT_EQ(grid.code(Float4(0, 0, 0, 0)), 0u);
  EXPECT_EQ(grid.code(Float4(1, 0, 0, 0)), 4u);
  EXPECT_EQ(grid.code(Float4(0, 2, 1, 0)), 0b010'001u);
  EXPECT_EQ(grid.code(Float4(1024, 1024, 512, 0)), 0b111'110'110'110'110'110'110'110'110'110u) << "cells are cubes";
}

TEST(Median, HalvesAndHasTheLeastDepth) {
  BuildConfig config = config_of(BuilderKind::kMedian);
  config.max_leaf_size = 1;
  const Bvh2 tree = build(scattered(1024), config);
  EXPECT_EQ(tree.depth, 10u);
  EXPECT_EQ(count_below(tree, 2), 512u);
}

}  // namespace
}  // namespace perfect_bvh::test
