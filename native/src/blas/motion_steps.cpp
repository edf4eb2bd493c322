#include "blas/motion_steps.h"

#include <algorithm>

#include "blas/build_wide_tree.h"
#include "wide/wide_boxes.h"
#include "wide/wide_refit.h"

namespace perfect_bvh {
namespace {

TreeStep step_of(const Blas& blas) noexcept {
  TreeStep step;
  step.nodes = blas.wide.nodes.data();
  if (blas.mesh.is_round()) {
    step.round_leaves = &blas.round_leaves;
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

// The same primitives half-way between the first step and the last.
std::shared_ptr<const Mesh> middle_of(const Mesh& mesh) {
  const std::uint32_t step = mesh.times.last / 2;
  if (mesh.times.last % 2 == 0) return mesh.later[step - 1];
  auto middle = std::make_shared<Mesh>(mesh.at_step(step));
  middle->later.clear();
  const Mesh& next = *mesh.later[step];
  const auto go_half_way = [](Vec3f& at, Vec3f to) { at = at * 0.5f + to * 0.5f; };
  for (std::size_t i = 0; i < middle->positions.size(); ++i) go_half_way(middle->positions[i], next.positions[i]);
  for (std::size_t i = 0; i < middle->balls.size(); ++i) {
    Ball& ball = middle->balls[i];
    go_half_way(ball.centre, next.balls[i].centre);
    ball.radius = 0.5f * ball.radius + 0.5f * next.balls[i].radius;
  }
  return middle;
}

}  // namespace

void build_moving_tree(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  Blas middle(middle_of(blas.mesh));
  middle.config = blas.config;
  build_wide_tree(middle, report, pool, cancel);
  blas.config = middle.config;
  if (middle.wide.is_empty) {
    blas.wide = std::move(middle.wide);
    return;
  }
  complete_plan(blas.refit_plan, middle.wide, middle.mesh, pool, cancel);
  refit_wide(middle.wide, blas.refit_plan, blas.mesh, blas.wide, false, pool, cancel);
  blas.box = mesh_bounds_of(blas.wide, blas.mesh);
}

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
    step.round_leaves = view_leaves(step.wide, step.mesh);
  };
  settle(blas);
  blas.steps.push_back(step_of(blas));
  for (const auto& step : blas.later) {
    settle(*step);
    blas.steps.push_back(step_of(*step));
  }
}

}  // namespace perfect_bvh
