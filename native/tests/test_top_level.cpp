// The top level: clustering compared with its plain O(N^3) version, hard input, and the choice between the trees.
#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "builders/agglomerative.h"
#include "builders/builder.h"
#include "builders/quality.h"
#include "core/errors.h"
#include "tests/box_sets.h"
#include "tests/same_bytes.h"
#include "tests/thread_counts.h"
#include "tests/tree_faults.h"
#include "tlas/top_level.h"
#include "wide/fast_wide.h"

namespace perfect_bvh::test {
namespace {

BuildConfig single_leaves(BuilderKind kind) {
  BuildConfig config;
  config.builder = kind;
  config.max_leaf_size = 1;
  return config;
}

Bvh2 guide_of(const std::vector<PrimRef>& refs, BuilderKind kind = BuilderKind::kBinned) {
  ThreadPool pool(1);
  CancelToken cancel;
  return build_bvh2(refs, single_leaves(kind), pool, cancel);
}

Bvh2 cluster(const std::vector<PrimRef>& refs, BuilderKind guide = BuilderKind::kBinned) {
  CancelToken cancel;
  return build_agglomerative(guide_of(refs, guide), 0, refs, cancel);
}

Bvh2 top_level(const std::vector<PrimRef>& refs, int thread_count = 1, std::uint32_t most_clusters = kMostClusters) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  const double enough_rays = std::max(kUnknownRays, 100.0 * static_cast<double>(refs.size()));
  return build_top_level(refs, pool, cancel, most_clusters, enough_rays).tree;
}

TopLevel built_for(const std::vector<PrimRef>& refs, double rays) {
  ThreadPool pool(1);
  CancelToken cancel;
  return build_top_level(refs, pool, cancel, kMostClusters, rays);
}

double area_of(const Aabb& box) {
  const Vec3d e = to_double(box.upper) - to_double(box.lower);
  return e.x * e.y + e.y * e.z + e.z * e.x;
}

double inner_area(const Bvh2& tree) {
  double sum = 0;
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    if (!tree.nodes[i].is_leaf() && i != 1) sum += area_of(tree.nodes[i].box());
  }
  return sum;
}

// Tries every pair before every join.
double plain_clustering_area(const std::vector<PrimRef>& refs) {
  struct Cluster {
    Aabb box;
    std::uint32_t count, id;
  };
  std::vector<Cluster> clusters;
  for (std::uint32_t i = 0; i < refs.size(); ++i) clusters.push_back({refs[i].box(), 1, i});
  double sum = 0;
  while (clusters.size() > 1) {
    std::size_t best_a = 0, best_b = 1;
    auto best = std::tuple(1e300, 1e300, 0u, 0u, 0u);
    for (std::size_t a = 0; a < clusters.size(); ++a) {
      for (std::size_t b = a + 1; b < clusters.size(); ++b) {
        Aabb box = clusters[a].box;
        box.grow(clusters[b].box);
        const Vec3d e = to_double(box.upper) - to_double(box.lower);
        const auto ids = std::minmax(clusters[a].id, clusters[b].id);
        const auto cost =
            std::tuple(area_of(box), e.x + e.y + e.z, clusters[a].count + clusters[b].count, ids.first, ids.second);
        if (cost < best) best = cost, best_a = a, best_b = b;
      }
    }
    Cluster& a = clusters[best_a];
    const Cluster b = clusters[best_b];
    a.box.grow(b.box);
    a.count += b.count;
    a.id = std::min(a.id, b.id);
    sum += area_of(a.box);
    clusters.erase(clusters.begin() + static_cast<std::ptrdiff_t>(best_b));
  }
  return sum;
}

// Boxes with integer corners: many pairs have exactly the same cost.
std::vector<PrimRef> whole_numbered(std::size_t count, unsigned seed, int side) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> place(0, side), size(0, 2);
  const auto whole = [&](auto& distribution) { return static_cast<float>(distribution(random)); };
  std::vector<PrimRef> refs;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f lower{whole(place), whole(place), whole(place)};
    refs.push_back(make_ref(lower, lower + Vec3f{whole(size), whole(size), whole(size)}, i));
  }
  return refs;
}

// Boxes of all sizes, some of them around others.
std::vector<PrimRef> mixed_sizes(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-1.0f, 1.0f), exponent(-8.0f, 0.0f);
  std::vector<PrimRef> refs;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f lower{place(random), place(random), place(random)};
    const auto size = [&] { return std::exp2(exponent(random)); };
    refs.push_back(make_ref(lower, lower + Vec3f{size(), size(), size()}, i));
  }
  return refs;
}

std::vector<NamedSet> small_sets() {
  std::vector<NamedSet> sets;
  for (unsigned seed = 0; seed < 12; ++seed) {
    const std::size_t count = 2 + seed * 7;
    sets.push_back({"scattered", scattered(count, seed)});
    sets.push_back({"whole-numbered", whole_numbered(count, seed, 5)});
    sets.push_back({"mostly duplicates", whole_numbered(count, seed, 1)});
    sets.push_back({"mixed sizes", mixed_sizes(count, seed)});
  }
  sets.push_back({"identical", repeated(60, {0, 0, 0}, {1, 1, 1})});
  sets.push_back({"one place", repeated(60, {1, 2, 3}, {1, 2, 3})});
  sets.push_back({"concentric", concentric(60)});
  sets.push_back({"cornered", cornered(50)});
  sets.push_back({"points on a line", points_on_line(80)});
  sets.push_back({"ground and pebbles", ground_and_pebbles(80)});
  return sets;
}

TEST(Agglomerative, CostsWhatTryingAllPairsCosts) {
  for (const NamedSet& set : small_sets()) {
    const double expected = plain_clustering_area(set.refs);
    for (const BuilderKind guide : {BuilderKind::kBinned, BuilderKind::kMedian}) {
      const Bvh2 tree = cluster(set.refs, guide);
      ASSERT_EQ(find_fault(tree, set.refs.size()), "") << set.name;
      EXPECT_NEAR(inner_area(tree), expected, expected * 1e-6) << set.name << " " << set.refs.size();
    }
  }
}

// The best match is the same for every search tree: only the order of joining differs.
TEST(Agglomerative, DoesNotDependOnTheGuide) {
  for (const auto& refs : {scattered(3000), whole_numbered(3000, 1, 12), mixed_sizes(3000, 1)}) {
    const double area = inner_area(cluster(refs));
    const double rounding = area * 1e-12;  // of sums in another order
    EXPECT_NEAR(inner_area(cluster(refs, BuilderKind::kMedian)), area, rounding);
    EXPECT_NEAR(inner_area(cluster(refs, BuilderKind::kSweep)), area, rounding);
  }
}

TEST(Agglomerative, MakesSoundTreesOfHardInput) {
  for (const NamedSet& set : hard_sets()) {
    const Bvh2 tree = cluster(set.refs);
    EXPECT_EQ(find_fault(tree, set.refs.size()), "") << set.name;
    EXPECT_EQ(measure_quality(tree).max_leaf_size, 1u) << set.name;
  }
}

TEST(Agglomerative, BoundsChainsInDepth) {
  const auto refs = concentric(5000);  // the nearest neighbour of each box is the next larger one: a chain of 5000
  const Bvh2 tree = cluster(refs);
  EXPECT_EQ(tree.depth, kMaxTreeDepth);
  CancelToken cancel;
  const std::uint32_t levels_above = 70;
  const Bvh2 lower_part = build_agglomerative(guide_of(refs), 0, refs, cancel, levels_above);
  EXPECT_EQ(find_fault(lower_part, refs.size()), "");
  EXPECT_LE(lower_part.depth + levels_above, kMaxTreeDepth);
}

TEST(Agglomerative, StopsWhenAsked) {
  const auto refs = scattered(5000);
  const Bvh2 guide = guide_of(refs);
  CancelToken cancel;
  cancel.request_stop();
  EXPECT_THROW((void)build_agglomerative(guide, 0, refs, cancel), Cancelled);
}

TEST(TopLevel, IsSoundOverHardInput) {
  for (const NamedSet& set : hard_sets()) {
    for (const std::uint32_t most_clusters : {1u, 2u, 100u, kMostClusters}) {
      const Bvh2 tree = top_level(set.refs, 1, most_clusters);
      EXPECT_EQ(find_fault(tree, set.refs.size()), "") << set.name << " " << most_clusters;
      EXPECT_EQ(measure_quality(tree).max_leaf_size, 1u) << set.name;
    }
  }
}

TEST(TopLevel, HasNothingOverNothingAndOneLeafOverOne) {
  EXPECT_TRUE(top_level({}).empty());
  auto one = scattered(1);
  one[0].prim_index = 7;
  const Bvh2 tree = top_level(one);
  ASSERT_EQ(tree.nodes.size(), 1u);
  EXPECT_EQ(tree.prim_indices[0], 7u);
  EXPECT_EQ(top_level(scattered(2)).nodes.size(), 4u);
}

TEST(TopLevel, HasTheSameBytesForAnyThreadCount) {
  for (const auto& refs : {ground_and_pebbles(500), ground_and_pebbles(30000), mixed_sizes(100000, 3)}) {
    const Bvh2 alone = top_level(refs);
    EXPECT_EQ(find_fault(alone, refs.size()), "");
    for (const int thread_count : thread_counts()) EXPECT_TRUE(same_bytes(alone, top_level(refs, thread_count)));
  }
}

TEST(TopLevel, NumbersInstancesAsTheCallerDoes) {
  auto refs = mixed_sizes(3000, 5);
  for (PrimRef& ref : refs) ref.prim_index = 2999 - ref.prim_index;
  const Bvh2 tree = top_level(refs);
  EXPECT_EQ(find_fault(tree, refs.size()), "");
  for (const Bvh2Node& node : tree.nodes) {
    if (!node.is_leaf()) continue;
    EXPECT_EQ(node.lower, refs[2999 - tree.prim_indices[node.first]].lower);
  }
}

TEST(TopLevel, CostsNoMoreThanEitherOfItsTrees) {
  for (const auto& refs :
       {scattered(1000), whole_numbered(1000, 2, 9), mixed_sizes(1000, 7), ground_and_pebbles(900)}) {
    const double area = inner_area(built_for(refs, 1e9).tree);
    EXPECT_LE(area, inner_area(cluster(refs)));
    EXPECT_LE(area, inner_area(guide_of(refs)));
  }
}

TEST(TopLevel, IsBuiltForTheRaysToCome) {
  const auto refs = scattered(5000);
  EXPECT_STREQ(built_for(refs, 1e4).builder, "fast");
  EXPECT_STREQ(built_for(refs, 1e6).builder, "binned");
}

// Adds the numbers below a child to `found`. Each box above one must be exactly around its boxes.
Aabb visit_below(const WideBvh& tree, std::uint32_t child, const std::vector<PrimRef>& refs,
                 std::vector<std::uint32_t>& found) {
  if (child >= kInstanceChild) {
    found.push_back(child - kInstanceChild);
    return refs[child - kInstanceChild].box();
  }
  const WideNode& node = tree.nodes[child];
  Aabb box;
  for (std::uint32_t lane = 0; lane < kWideWidth && node.child[lane] != kNoChild; ++lane) {
    const Aabb below = visit_below(tree, node.child[lane], refs, found);
    EXPECT_EQ(child_box(node, lane).lower, below.lower * tree.scale);
    EXPECT_EQ(child_box(node, lane).upper, below.upper * tree.scale);
    box.grow(below);
  }
  return box;
}

TEST(TopLevel, WithoutABinaryTreeHoldsEveryInstanceOnce) {
  std::vector<std::vector<PrimRef>> sets{scattered(1), scattered(2), scattered(9)};
  for (const auto& set : hard_sets()) sets.push_back(set.refs);
  for (const auto& refs : sets) {
    const TopLevel top = built_for(refs, 0.0);
    ASSERT_TRUE(top.tree.empty());
    std::vector<std::uint32_t> found;
    static_cast<void>(visit_below(top.wide, top.wide.root, refs, found));
    std::sort(found.begin(), found.end());
    ASSERT_EQ(found.size(), refs.size());
    for (std::size_t i = 0; i < found.size(); ++i) ASSERT_EQ(found[i], i);
    CancelToken cancel;
    EXPECT_TRUE(is_over(top.wide, refs, cancel));
    EXPECT_FALSE(is_over(top.wide, std::span(refs).first(refs.size() - 1), cancel));
    for (const int thread_count : thread_counts()) {
      ThreadPool pool(thread_count);
      EXPECT_TRUE(same_bytes(build_fast_top_level(refs, pool, cancel), top.wide));
    }
  }
}

// If one is much larger than the others and there are enough rays, or if there are very many rays.
TEST(TopLevel, TriesClusteringWhereItMayPay) {
  EXPECT_FALSE(built_for(scattered(5000), 1e6).tried_clustering);
  EXPECT_TRUE(built_for(scattered(5000), 1e9).tried_clustering);
  EXPECT_FALSE(built_for(ground_and_pebbles(5000), 1e4).tried_clustering);
  EXPECT_TRUE(built_for(ground_and_pebbles(5000), 1e7).tried_clustering);
}

// The huge box is separated from any number of small ones: planes through centroids cannot do that.
TEST(TopLevel, KeepsAHugeInstanceAway) {
  for (const std::size_t count : {500u, 20000u}) {
    const auto refs = ground_and_pebbles(count);
    const double huge = area_of(refs.back().box());
    const Bvh2 tree = top_level(refs);
    EXPECT_LT(inner_area(tree), 1.01 * huge) << count;
    EXPECT_GT(inner_area(guide_of(refs)), 2 * huge) << count;
  }
}

}  // namespace
}  // namespace perfect_bvh::test
