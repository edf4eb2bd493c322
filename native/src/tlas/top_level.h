// The tree over a scene's instances.
// In: the world boxes of instances. Out: a wide tree, the same bytes for any number of threads.
//
// If there are few rays per instance, the tree is clustered along a Morton curve, without a binary tree in between.
// That takes half of the time of the binned tree and its collapse, but rays visit 2 to 7 percent more of this level's
// nodes, or 20 if a floor or walls surround small instances. Tried and rejected: the builder over Morton clusters
// instead of the binned one (a third fewer instructions, 5 to 8 percent more visits).
// Also rejected: opening instances, so that parts of them are in the tree (Benthin, Woop, Wald and Afra 2017, "Improved
// two-level BVHs using partial re-braiding"). Its possible gain was measured with a separate instance for each subtree
// (with a row of InstanceView each, which a real implementation would share), and compared with one tree over all
// triangles in world space. Times are ratios to that tree's.
// - 1,000 and 10,000 small meshes, each used once (tests/benchmarks/shared_tree.py): two levels visit hardly more than
//   the one tree (12 nodes and instances per ray against 11, 20 against 18), so no other tree can gain much. Most time
//   is spent on entering instances: meshes of one leaf, which cannot be opened, take 1.4 and 1.6; boxes 1.5 and 2.2,
//   entered leaf by leaf 1.7 and 2.1; spheres 1.6 and 1.7, in 4 parts 1.8 and 2.0, in 8 parts 2.2 and 2.3.
// - 216 instances of 5,000 triangles: apart on a grid .87, in 16 parts 1.3. In a heap, where each overlaps dozens of
//   others, 53 nodes per ray become 27 in 64 parts, and 2.8 becomes 2.2, for 64 times the references. If they are
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

// The maximum number of clusters joined pair by pair: the instances themselves if they are not more, else the parts of
// a binned tree. Measured with 1,000 to 100,000 boxes on one thread: joining takes 1 to 2 us per cluster, more for
// larger numbers, against 0.2 us per instance for the binned tree. If small instances are on top of large ones, 256
// clusters already give the whole gain (SAH 2.0 against 7.0 binned). If all have similar sizes, the binned tree is
// better (SAH 191 against 224): then, or for few rays, clustering is not tried.
inline constexpr std::uint32_t kMostClusters = 1024;

struct TopLevel {
  Bvh2 tree;  // with one instance per leaf, to be collapsed; empty if the wide tree was built directly
  WideBvh wide;
  const char* builder = "";  // "agglomerative", or the tree's builder if that gained nothing; "" if empty
  bool tried_clustering = false;
  double build_milliseconds = 0, clustering_milliseconds = 0;
};

// Nanoseconds, measured on one thread with 1,000 to 100,000 instances: to build and collapse the tree per instance, to
// join one cluster, and for one expected visit. Rays end at their first hit: on a grid of 100,000 instances they make a
// fifth of the visits that the heuristic expects, of 20 ns each.
inline constexpr double kBuildNanoseconds = 450.0, kJoinNanoseconds = 1400.0, kVisitNanoseconds = 4.0;
// The rays cast at a scene before it changes, if their number is unknown: the first rays of an image of 960 by 540.
inline constexpr double kUnknownRays = 5e5;

// The expected visits of a random ray through the whole box (MacDonald and Booth 1990). 0 if the box has no extent.
struct TopLevelCost {
  double node_visits = 0;       // of the wide tree
  double instance_entries = 0;  // does not depend on the tree
};

// Builds the tree. Boxes must not be empty or infinite; their numbers need not be rows. expected_rays: to be cast at
// the scene; kUnknownRays if unknown. Throws Cancelled, bad_alloc.
[[nodiscard]] TopLevel build_top_level(std::span<const PrimRef> prims, ThreadPool& pool, CancelToken& cancel,
                                       std::uint32_t most_clusters = kMostClusters,
                                       std::optional<double> expected_rays = std::nullopt);

// Refits the top level: instances that only moved keep their position in the tree, which gets new boxes (lecture,
// "Refitting"). Also decides when another tree would be better.

[[nodiscard]] TopLevelCost measure_cost(const WideBvh& wide, ThreadPool& pool, CancelToken& cancel);

// Returns whether the tree is over exactly the instances that have a box now. boxes: one per row, empty for an empty
// instance.
[[nodiscard]] bool is_over(const WideBvh& tree, std::span<const PrimRef> boxes, CancelToken& cancel);

// Refits in two steps, since the second is wasted if the tree is rebuilt. The first writes new boxes to the wide tree,
// which must be over `boxes`: enough to measure its cost.
void refit_boxes(WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel);
// Returns the tree at a time within the shutter, at which the instances have these boxes. `wide` is over their whole
// motion; its scale and extent are kept.
[[nodiscard]] WideBvh refitted_at_step(const WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool,
                                       CancelToken& cancel);
// Returns whether rays are as fast through `wide`, around the whole motion of its instances, as between trees at the
// times of the shutter, of which `step` is one. Those are tighter, but a visit of one of their nodes takes longer.
[[nodiscard]] bool serves_all_times(const WideBvh& wide, const WideBvh& step, ThreadPool& pool, CancelToken& cancel);
// The second step: updates the visiting orders.
void finish_refit(WideBvh& wide, ThreadPool& pool, CancelToken& cancel);

// Returns whether the rays' loss on a refitted tree is at most the cost of another tree. `built` was measured when the
// tree was built. If instances cover less of the whole box than they did then, a new tree might be much better than the
// old one was. tries_clustering: as in the last build. expected_rays: to be cast at the scene; kUnknownRays if unknown.
[[nodiscard]] bool is_worth_keeping(const TopLevelCost& now, const TopLevelCost& built, std::size_t instance_count,
                                    bool tries_clustering, std::optional<double> expected_rays);
// Returns the reason for that decision, as a clause.
[[nodiscard]] std::string describe(const TopLevelCost& now, const TopLevelCost& built);

}  // namespace perfect_bvh
