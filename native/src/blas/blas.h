// The tree of one distinct mesh (bottom-level acceleration structure), with its geometry.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "blas/spare_memory.h"
#include "blas/support.h"
#include "builders/build_config.h"
#include "builders/quality.h"
#include "mesh/mesh.h"
#include "traverse/motion_view.h"
#include "traverse/scene_view.h"
#include "wide/refit_plan.h"
#include "wide/wide_bvh.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {

// Immutable once a snapshot refers to it.
struct Blas {
  explicit Blas(std::shared_ptr<const Mesh> the_mesh) : owned_mesh(std::move(the_mesh)), mesh(*owned_mesh) {}
  Blas(const Blas&) = delete;
  Blas& operator=(const Blas&) = delete;
  ~Blas() {
    if (spare) spare->give({std::move(wide), shape});
  }

  const std::shared_ptr<const Mesh> owned_mesh;
  const Mesh& mesh;
  BuildConfig config;   // that the tree was built with, its builder named; refits keep it
  TreeQuality quality;  // of the binary tree that `wide` was made from; empty where there was none, or it was refitted
  WideBvh wide;         // what rays are traced through
  RoundLeaves round_leaves;  // of `wide`, over curves or points
  std::uint64_t shape = 0;
  std::shared_ptr<const WideCosts> fresh_costs;  // of each part of `wide` when it was built; null before it is refitted
  double built_sah = 0;              // of `wide` when it was built, as tree_boxes.h reckons it; 0 before it is refitted
  RefitPlan refit_plan;              // of `wide`; likewise
  std::shared_ptr<SpareTree> spare;  // where `wide` goes at the end; null: nowhere
  Aabb box;                          // around the triangles
  LazySupport support;               // of `wide`, made when one of many instances is turned
  // Of a mesh that moves within the shutter (motion_steps.h): its trees at the steps that follow, of which no more is
  // filled in than rays need; and all of its steps as kernels see them.
  std::vector<std::shared_ptr<Blas>> later;
  std::vector<TreeStep> steps;
};

// What kernels see of the leaves of such a tree over curves or points and of its mesh, which must both stay where they
// are.
[[nodiscard]] inline RoundLeaves view_leaves(const WideBvh& tree, const Mesh& mesh) noexcept {
  RoundList round{mesh.balls.data(), mesh.segments.data(), tree.scale, mesh.shape};
  round.closed = mesh.closed.data(), round.closed_count = mesh.closed.size();
  const CurveLeaf* const curves = tree.curve_leaves.empty() ? nullptr : tree.curve_leaves.data();
  return {tree.point_leaves.data(), curves, round};
}

// Of what refits go by; 0 before the first one.
[[nodiscard]] inline std::size_t plan_byte_count(const Blas& blas) noexcept {
  return blas.refit_plan.byte_count() + (blas.fresh_costs ? blas.fresh_costs->byte_count() : 0);
}

// Of the steps after the first, of one that moves within the shutter.
[[nodiscard]] inline std::size_t motion_byte_count(const Blas& blas) noexcept {
  std::size_t count = 0;
  for (const auto& step : blas.later) {
    count += step->mesh.positions.size() * sizeof(Vec3f) + step->mesh.balls.size() * sizeof(Ball);
    count += step->wide.byte_count();
  }
  return count;
}

// Geometry, trees and plan.
[[nodiscard]] inline std::size_t byte_count(const Blas& blas) noexcept {
  return blas.mesh.byte_count() + blas.wide.byte_count() + plan_byte_count(blas) + motion_byte_count(blas);
}

}  // namespace perfect_bvh
