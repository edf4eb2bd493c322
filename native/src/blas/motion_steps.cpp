#include "blas/motion_steps.h"

#include <algorithm>

#include "wide/wide_boxes.h"
#include "wide/wide_refit.h"

namespace perfect_bvh {
namespace {

TreeStep step_of(const Blas& blas) noexcept {
  TreeStep step;
  step.nodes = blas.wide.nodes.data();
  if (blas.wide.blocks.empty()) {
    step.indexed_leaves = &blas.indexed_leaves;
  } else {
    step.blocks = blas.wide.blocks.data();
  }
  return step;
}

// Of all steps, which are not empty.
Aabb bounds_of(const Blas& blas) noexcept {
  Aabb box = blas.box;
  for (const auto& step : blas.later) box.grow(step->box);
  return box;
}

// A ball's box is its centre less and plus its radius, each interpolated and rounded: by 3 u R more than the slab test
// has room for (math/slab.h), which goes with the extent.
void widen(TreeExtent& extent) noexcept {
  for (float& largest : extent.largest) largest *= 1.5f;
  extent.reach *= 1.5f;
}

}  // namespace

void add_motion_steps(Blas& blas, ThreadPool& pool, CancelToken& cancel) {
  if (!blas.mesh.moves() || blas.wide.is_empty) return;
  complete_plan(blas.refit_plan, blas.wide, blas.mesh, pool, cancel);
  blas.later.reserve(blas.mesh.later.size());
  for (const auto& mesh : blas.mesh.later) {
    auto step = std::make_shared<Blas>(mesh);
    refit_wide(blas.wide, blas.refit_plan, *mesh, step->wide, false, pool, cancel);
    step->box = mesh_bounds_of(step->wide, *mesh);
    blas.later.push_back(std::move(step));
  }
  const Aabb bounds = bounds_of(blas);
  const float scale = tree_scale(bounds);
  const auto settle = [&](Blas& step) {
    if (step.wide.scale != scale)
      refit_wide(step.wide, blas.refit_plan, step.mesh, step.wide, true, pool, cancel, scale);
    step.wide.extent = tree_extent(bounds, scale);
    if (step.mesh.is_round()) widen(step.wide.extent);
    step.indexed_leaves = view_leaves(step.wide, step.mesh);
  };
  settle(blas);
  blas.steps.push_back(step_of(blas));
  for (const auto& step : blas.later) {
    settle(*step);
    blas.steps.push_back(step_of(*step));
  }
}

}  // namespace perfect_bvh
