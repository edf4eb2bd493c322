// Reinsertion: the same leaves, never a higher cost, sound trees, budgets kept.
#include <gtest/gtest.h>

#include <algorithm>

#include "builders/builder.h"
#include "builders/link_tree.h"
#include "builders/optimize.h"
#include "builders/quality.h"
#include "core/errors.h"
#include "tests/box_sets.h"
#include "tests/tree_faults.h"

namespace perfect_bvh::test {
namespace {

Bvh2 build(const std::vector<PrimRef>& refs, BuilderKind kind = BuilderKind::kBinned) {
  ThreadPool pool(1);
  CancelToken cancel;
  BuildConfig config;
  config.builder = kind;
  return build_bvh2(refs, config, pool, cancel);
}

OptimizeReport optimize(Bvh2& tree, std::uint32_t passes, int thread_count = 2) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  return optimize_bvh2(tree, passes, pool, cancel);
}

// Returns the leaves as sorted lists of primitives, in sorted order.
std::vector<std::vector<std::uint32_t>> leaves(const Bvh2& tree) {
  std::vector<std::vector<std::uint32_t>> all;
  for (const Bvh2Node& node : tree.nodes) {
    if (!node.is_leaf()) continue;
    const auto first = tree.prim_indices.begin() + node.first;
    all.emplace_back(first, first + node.count);
    std::sort(all.back().begin(), all.back().end());
  }
  std::sort(all.begin(), all.end());
  return all;
}

TEST(Optimize, KeepsTheLeavesAndNeverCostsMore) {
  for (const NamedSet& set : hard_sets()) {
    Bvh2 tree = build(set.refs);
    const Bvh2 before = tree;
    optimize(tree, 4);
    EXPECT_EQ(find_fault(tree, set.refs.size()), "") << set.name;
    EXPECT_EQ(leaves(tree), leaves(before)) << set.name;
    EXPECT_LE(measure_quality(tree).sah, measure_quality(before).sah * (1 + 1e-6)) << set.name;
  }
}

TEST(Optimize, RepairsABadTree) {
  // A median split mixes the ground with the pebbles, and costs far more than necessary.
  const auto refs = ground_and_pebbles(5000);
  Bvh2 tree = build(refs, BuilderKind::kMedian);
  const double before = measure_quality(tree).sah;
  const OptimizeReport report = optimize(tree, 10);
  EXPECT_GT(report.moved, 0u);
  EXPECT_LT(measure_quality(tree).sah, 0.9 * before);
}

TEST(Optimize, GainsMoreWithMorePasses) {
  double last = 1e300;
  for (const std::uint32_t passes : {0u, 6u, 12u}) {
    Bvh2 tree = build(scattered(5000), BuilderKind::kMedian);
    optimize(tree, passes);
    const double sah = measure_quality(tree).sah;
    EXPECT_LT(sah, last) << passes;
    last = sah;
  }
}

TEST(Optimize, StopsByItselfWhenNothingGains) {
  Bvh2 tree = build(scattered(500));
  const OptimizeReport report = optimize(tree, 1000);
  EXPECT_LT(report.passes, 100u);
  const Bvh2 before = tree;
  EXPECT_LE(measure_quality(tree).sah, measure_quality(before).sah);
}

TEST(Optimize, KeepsItsBudget) {
  ThreadPool pool(1);
  CancelToken cancel;
  Bvh2 tree = build(scattered(2000), BuilderKind::kMedian);
  EXPECT_EQ(optimize_bvh2(tree, 2, pool, cancel).passes, 2u);
  EXPECT_EQ(optimize_bvh2(tree, 0, pool, cancel).passes, 0u);
}

TEST(Optimize, LeavesTheTreeAloneWhenCancelled) {
  ThreadPool pool(2);
  CancelToken cancel;
  cancel.request_stop();
  Bvh2 tree = build(scattered(2000));
  const Bvh2 before = tree;
  EXPECT_THROW(optimize_bvh2(tree, 3, pool, cancel), Cancelled);
  EXPECT_EQ(find_fault(tree, 2000), "");
  EXPECT_EQ(tree.prim_indices, before.prim_indices);
}

TEST(Optimize, WorksOnTreesTooSmallToImprove) {
  for (std::size_t count = 0; count < 5; ++count) {
    Bvh2 tree = build(scattered(count));
    EXPECT_EQ(optimize(tree, 3).moved, 0u);
    EXPECT_EQ(find_fault(tree, count), "");
  }
}

TEST(LinkTreeTest, GivesBackTheTreeItWasMadeOf) {
  const Bvh2 tree = build(scattered(1000));
  CancelToken never;
  const Bvh2 again = LinkTree(tree, never).to_bvh2(tree, never);
  EXPECT_EQ(find_fault(again, 1000), "");
  EXPECT_EQ(again.prim_indices, tree.prim_indices);
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    EXPECT_EQ(again.nodes[i].first, tree.nodes[i].first);
    EXPECT_EQ(again.nodes[i].lower, tree.nodes[i].lower);
    EXPECT_EQ(again.nodes[i].upper, tree.nodes[i].upper);
  }
}

TEST(LinkTreeTest, KeepsBoxesAndHeightsThroughMoves) {
  const Bvh2 tree = build(scattered(400));
  CancelToken never;
  LinkTree links(tree, never);
  std::mt19937 random(7);
  std::uniform_int_distribution<LinkTree::Id> any(2, static_cast<LinkTree::Id>(links.size() - 1));
  int moved = 0;
  for (int i = 0; i < 2000; ++i) {
    const LinkTree::Id moving = any(random), target = any(random);
    if (links.parent(moving) == LinkTree::kRoot || links.is_below(target, moving)) continue;
    if (target == links.parent(moving) || target == links.sibling(moving)) continue;
    if (links.depth_of(target) + 1 + std::max(links.height(moving), links.height(target)) > kMaxTreeDepth) continue;
    links.move(moving, target);
    ++moved;
  }
  EXPECT_GT(moved, 100);
  EXPECT_EQ(find_fault(links.to_bvh2(tree, never), 400), "");
}

}  // namespace
}  // namespace perfect_bvh::test
