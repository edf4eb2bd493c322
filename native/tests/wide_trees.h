// Wide trees of every kind that can be refitted, and the properties that they must have.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "blas/build_tree.h"
#include "tests/motions.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"
#include "wide/wide_bvh.h"
#include "wide/wide_refit.h"

namespace perfect_bvh::test {

struct Way {
  const char* name;
  BuildConfig config;
  Usage usage = Usage::kDeforming;
};

inline std::ostream& operator<<(std::ostream& out, const Way& way) { return out << way.name; }

inline std::vector<Way> ways() {
  std::vector<Way> list;
  for (const BuilderKind kind :
       {BuilderKind::kAuto, BuilderKind::kMedian, BuilderKind::kSweep, BuilderKind::kBinned, BuilderKind::kFast}) {
    BuildConfig config;
    config.builder = kind;
    list.push_back({builder_name(kind), config});
  }
  list.push_back({"straight_to_wide", BuildConfig{}, Usage::kChanging});
  return list;
}

inline WideBvh build(const Mesh& mesh, const Way& way) {
  ThreadPool pool(1);
  CancelToken cancel;
  if (way.usage == Usage::kChanging) return build_fast_wide(mesh, pool, cancel);
  const Bvh2 tree = build_tree(mesh, choose_builder(way.config, way.usage), pool, cancel);
  return collapse_mesh(tree, mesh, pool, cancel);
}

inline RefitPlan plan_of(const WideBvh& tree, const Mesh& mesh) {
  ThreadPool pool(1);
  CancelToken cancel;
  RefitPlan plan;
  complete_plan(plan, tree, mesh, pool, cancel);
  return plan;
}

inline WideBvh refitted(const WideBvh& tree, const Mesh& mesh, int thread_count = 1) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  WideBvh result;
  static_cast<void>(refit_wide(tree, plan_of(tree, mesh), mesh, result, false, pool, cancel));
  return result;
}

inline Mesh moved(Mesh mesh, const Motion& motion) {
  motion.apply(mesh.positions);
  return mesh;
}

inline Aabb triangle_bounds(const Mesh& mesh) {
  Aabb box;
  for (std::size_t i = 0; i < mesh.primitive_count(); ++i) box.grow(mesh.primitive_box(i));
  return box;
}

// Checks that no box is larger than its content; scale and extent are those of a new tree.
inline void expect_tight(const WideBvh& tree, const Mesh& mesh, const std::string& name) {
  if (tree.is_empty) return;
  const Aabb bounds = triangle_bounds(mesh);
  EXPECT_EQ(tree.scale, tree_scale(bounds)) << name;
  EXPECT_EQ(tree.extent.reach, tree_extent(bounds, tree.scale).reach) << name;
  for (const WideNode& node : tree.nodes) {
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      const std::uint32_t child = node.child[lane];
      if (child == kNoChild) continue;
      Aabb inside;
      if (child >= kBlockChild) {
        inside = leaf_box(tree, mesh, child - kBlockChild);
      } else {
        for (std::uint32_t i = 0; i < kWideWidth; ++i) inside.grow(child_box(tree.nodes[child], i));
      }
      ASSERT_EQ(child_box(node, lane).lower, inside.lower) << name;
      ASSERT_EQ(child_box(node, lane).upper, inside.upper) << name;
    }
  }
}

}  // namespace perfect_bvh::test
