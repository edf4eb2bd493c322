// The tree over several shapes: sound, cheaper over all of them, the same for any number of threads.
#include <gtest/gtest.h>

#include "blas/build_tree.h"
#include "builders/animated.h"
#include "core/errors.h"
#include "tests/mesh_sets.h"
#include "tests/motions.h"
#include "tests/same_bytes.h"
#include "tests/swarms.h"
#include "tests/thread_counts.h"
#include "tests/tree_faults.h"
#include "tests/wide_trees.h"

namespace perfect_bvh::test {
namespace {

Bvh2 build_over(const Mesh& mesh) {
  ThreadPool pool(1);
  CancelToken cancel;
  BuildConfig config;
  config.builder = BuilderKind::kBinned;
  return build_tree(mesh, config, pool, cancel);
}

Bvh2 optimized(const Mesh& middle, const SampledBoxes& shapes, int thread_count = 1) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  Bvh2 tree = build_over(middle);
  static_cast<void>(optimize_over_samples(tree, shapes, 6, pool, cancel));
  return tree;
}

double mean_cost(const Bvh2& tree, const Mesh& middle, const Shapes& shapes) {
  ThreadPool pool(1);
  CancelToken cancel;
  const WideBvh wide = collapse_mesh(tree, middle, TreeLayout::kDefault, pool, cancel);
  double sum = 0;
  for (std::size_t i = 0; i < shapes.sample_count(); ++i) {
    const WideBvh at_shape = refitted(wide, shapes[i]);
    EXPECT_EQ(find_wide_fault(at_shape, shapes[i], true), "") << i;
    const TraceWork work = measure_trace_work(at_shape, shapes[i], cancel);
    sum += work.node_visits + 0.5 * work.leaf_visits;
  }
  return sum / static_cast<double>(shapes.sample_count());
}

TEST(AnimatedTree, CostsLessOverAllShapes) {
  for (const std::size_t count : {4u, 5u, 9u, 64u}) {
    const Shapes shapes = swarms(count);
    const Mesh& middle = shapes[0];  // a tree that mixes the swarms
    const Bvh2 tree = optimized(middle, shapes);
    EXPECT_EQ(find_fault(tree, middle.primitive_count()), "") << count;
    EXPECT_LT(mean_cost(tree, middle, shapes), 0.8 * mean_cost(build_over(middle), middle, shapes)) << count;
  }
}

TEST(AnimatedTree, IsTheSameForAnyNumberOfThreads) {
  const Shapes shapes = swarms(6, 20000);
  const Bvh2 tree = optimized(shapes[3], shapes);
  for (const int count : thread_counts()) EXPECT_TRUE(same_bytes(optimized(shapes[3], shapes, count), tree)) << count;
}

// Whatever the shapes are, the tree is sound, and not deeper than any may be.
TEST(AnimatedTree, StandsHardShapes) {
  const Mesh still = triangle_soup(600, 0.1f);
  for (const Motion& motion : motions()) {
    const Shapes shapes({still, moved(still, motion), still});
    const Bvh2 tree = optimized(still, shapes);
    EXPECT_EQ(find_fault(tree, still.primitive_count()), "") << motion.name;
    EXPECT_LE(tree.depth, kMaxTreeDepth) << motion.name;
    const Bvh2 over_moved = optimized(shapes[1], shapes);
    EXPECT_EQ(find_fault(over_moved, still.primitive_count()), "") << motion.name;
  }
  for (const std::size_t count : {1u, 2u, 9u}) {
    const Mesh few = triangle_soup(count, 0.1f);
    EXPECT_EQ(find_fault(optimized(few, Shapes({few, few})), count), "") << count;
  }
}

TEST(AnimatedTree, RefusesClippedBoxes) {
  ThreadPool pool(1);
  CancelToken cancel;
  const Shapes shapes = swarms(2);
  Bvh2 tree = build_over(shapes[0]);
  tree.refittable = false;
  EXPECT_THROW(static_cast<void>(optimize_over_samples(tree, shapes, 1, pool, cancel)), InvalidArgument);
}

}  // namespace
}  // namespace perfect_bvh::test
