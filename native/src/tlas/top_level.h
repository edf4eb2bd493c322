// The tree over a scene's instances.
// In: the world boxes of instances. Out: a Bvh2 with one instance a leaf, the same bytes for any thread count.
//
// Where rays are few for so many instances the tree is clustered along a Morton curve: a third to a half of the binned
// tree's time, and rays visit 4 to 7 percent more of this level's nodes, or 20 where a floor or walls lie about small
// instances. Tried, and left out: the builder over Morton clusters in the place of the binned one (a third fewer
// instructions, 5 to 8 percent more visits).
// Left out, too: opening instances, so that parts of them stand in the tree (Benthin, Woop, Wald and Afra 2017,
// "Improved two-level BVHs using partial re-braiding"). What it would win was measured by giving subtrees instances of
// their own (a row of InstanceView each, which the real thing would share), beside one tree over all the triangles in
// world space; times are ratios to that tree's.
// - 1,000 and 10,000 small meshes, each used once (tests/benchmarks/shared_tree.py): two levels visit hardly more than
//   the one tree (12 nodes and instances a ray against 11, 20 against 18), so no other tree can win much. What takes
//   time is entering: meshes of one leaf, which leave nothing to open, take 1.4 and 1.6; boxes 1.5 and 2.2, entered
//   leaf by leaf 1.7 and 2.1; balls 1.6 and 1.7, in 4 parts 1.8 and 2.0, in 8 parts 2.2 and 2.3.
// - 216 instances of 5,000 triangles: apart on a grid .87, in 16 parts 1.3. In a heap, where each stands in dozens of
//   others, 53 nodes a ray become 27 in 64 parts, and 2.8 becomes 2.2, for 64 times the references; where they are
//   turned, so that the parts' boxes loosen, 2.7 stays 2.7.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// How many clusters are joined pair by pair: the instances themselves where they are no more, else the parts of a
// binned tree. Measured with 1,000 to 100,000 boxes on one thread: joining takes 1 to 2 us a cluster, more for larger
// numbers, against 0.2 us an instance for the binned tree. Where small instances stand on large ones, 256 clusters
// already give all that the whole would (SAH 2.0 against 7.0 binned). Where all have similar sizes the binned tree is
// better (SAH 191 against 224): there, or for few rays, clustering is not tried.
inline constexpr std::uint32_t kMostClusters = 1024;

struct TopLevel {
  Bvh2 tree;
  const char* builder = "";  // "agglomerative", or what made the tree where clustering gained nothing; "" over nothing
  bool tried_clustering = false;
  double build_milliseconds = 0, clustering_milliseconds = 0;
};

// Nanoseconds measured on one thread, with 1,000 to 100,000 instances: to build and collapse the tree over one, to join
// one cluster, and of a visit that is expected. Rays end at their first hit: on a grid of 100,000 instances they make a
// fifth of the visits that the heuristic expects, of 20 ns each.
inline constexpr double kBuildNanoseconds = 450.0, kJoinNanoseconds = 1400.0, kVisitNanoseconds = 4.0;
// The rays cast at a scene before it changes, where their number is unknown: the first rays of an image of 960 by 540.
inline constexpr double kUnknownRays = 5e5;

// What a random ray through all is expected to meet (MacDonald and Booth 1990). 0 where the whole has no extent.
struct TopLevelCost {
  double node_visits = 0;       // of the wide tree
  double instance_entries = 0;  // whatever the tree is
};

// Boxes must not be empty or infinite; their numbers need not be rows. expected_rays: about to be cast; kUnknownRays if
// unknown. Throws Cancelled, bad_alloc.
[[nodiscard]] TopLevel build_top_level(std::span<const PrimRef> prims, ThreadPool& pool, CancelToken& cancel,
                                       std::uint32_t most_clusters = kMostClusters,
                                       std::optional<double> expected_rays = std::nullopt);

// Refitting the top level: instances that only moved keep their places in the tree, which gets new boxes (lecture,
// "Refitting"). And the measure that tells when another tree would serve better.

[[nodiscard]] TopLevelCost measure_cost(const WideBvh& wide, ThreadPool& pool, CancelToken& cancel);

// Whether both trees stand over the instances that have a box now. boxes: one a row, empty over nothing.
[[nodiscard]] bool is_over(const Bvh2& tree, std::span<const PrimRef> boxes, CancelToken& cancel);

// In two steps, since the second is wasted on a tree that is then built anew. First new boxes for the wide tree, which
// must stand over `boxes`: enough to measure its cost.
void refit_boxes(WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel);
// The tree at a time of the shutter, at which the instances have these boxes; `wide` is over all of their ways, and its
// scale and extent are kept.
[[nodiscard]] WideBvh refitted_at_step(const WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool,
                                       CancelToken& cancel);
// Whether rays do as well through `wide`, around all ways of its instances, as between trees at the times of the
// shutter, of which `step` is one: those are tighter, and a visit of one of their nodes takes longer.
[[nodiscard]] bool serves_all_times(const WideBvh& wide, const WideBvh& step, ThreadPool& pool, CancelToken& cancel);
// Then its visiting orders, and the binary tree.
void finish_refit(Bvh2& tree, WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel);

// Whether rays lose no more on a refitted tree than another one costs. `built` was measured when the tree was built.
// Where instances cover less of the whole than they did then, a new tree might be so much better than that one was.
// tries_clustering: as the last build did. expected_rays: about to be cast; kUnknownRays if unknown.
[[nodiscard]] bool is_worth_keeping(const TopLevelCost& now, const TopLevelCost& built, std::size_t instance_count,
                                    bool tries_clustering, std::optional<double> expected_rays);
// What that was decided by, as a clause.
[[nodiscard]] std::string describe(const TopLevelCost& now, const TopLevelCost& built);

}  // namespace perfect_bvh
