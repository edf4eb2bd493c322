// Scene::make_blas: from a mesh that is new or was edited to what rays are traced through. Where only positions changed
// the tree is refitted; otherwise, or where a refitted one would be too slow, a binary tree is built and collapsed. Of
// a mesh whose topology changes the wide tree is built at once.

#include <algorithm>
#include <limits>

#include "build/optimize.h"
#include "core/stopwatch.h"
#include "scene/blas_build.h"
#include "scene/cover.h"
#include "scene/scene.h"
#include "scene/trace_view.h"
#include "update/quality.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"
#include "wide/wide_cost.h"
#include "wide/wide_rebuild.h"
#include "wide/wide_refit.h"
#include "wide/wide_rotation.h"

namespace perfect_bvh {
namespace {

// What a ray may be expected to cost more than when the tree was built: so much and the refitted tree is left as it is;
// so much and rotations mend it; so much after its spoilt parts were built anew and it stays.
constexpr double kRefitLimit = 1.05, kRotateLimit = 1.2, kMendLimit = 1.3;
// A part is spoilt where its root's children cover so much more than they did.
constexpr double kSpoilt = 1.1;

std::string times(double cost, double fresh_cost) {
  const auto tenths = static_cast<long>(std::min(cost / fresh_cost, 1e6) * 10.0 + 0.5);
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " times what it did when built";
}

const char* why_so_built(BuilderKind asked, BuilderKind chosen) {
  const bool is_for_speed = asked == BuilderKind::kAuto && chosen == BuilderKind::kFast;
  return is_for_speed ? "; its topology changes, so the fast builder made its tree" : "";
}

void build(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  Stopwatch watch;
  BuildConfig unoptimized = blas.config;
  unoptimized.optimize_passes = 0;
  Bvh2 tree = build_tree(blas.mesh, unoptimized, pool, cancel);
  report.build_milliseconds = watch.lap_milliseconds();
  if (blas.config.optimize_passes > 0) {
    const OptimizeBudget budget{blas.config.optimize_passes, blas.config.optimize_milliseconds};
    // From now on the settings are those that make this very tree again, however long that takes.
    blas.config.optimize_passes = optimize_bvh2(tree, budget, pool, cancel).passes;
    blas.config.optimize_milliseconds = std::numeric_limits<double>::infinity();
    report.optimize_milliseconds = watch.lap_milliseconds();
  }
  blas.quality = measure_quality(tree);
  blas.cover = make_cover(tree);
  watch.lap_milliseconds();
  blas.wide = collapse_mesh(tree, blas.mesh, blas.config.layout, pool, cancel);
  report.collapse_milliseconds = watch.lap_milliseconds();
}

void build_wide(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  const Stopwatch watch;
  blas.wide = build_fast_wide(blas.mesh, blas.config.layout, pool, cancel);
  blas.cover = make_cover(cover_boxes(blas.wide, blas.mesh, kCoverBoxes));
  report.build_milliseconds = watch.milliseconds();
}

// What a refitted tree would cost over the leaves that it has, if it stood over them as well as when it was built.
double predict_mended_cost(const WideBvh& tree, const WideCosts& costs, const WideCosts& fresh) {
  return fresh.whole(tree) - fresh.of_leaves(tree.root) + costs.of_leaves(tree.root);
}

// Mends a refitted tree by what is cheap.
void mend(Blas& blas, WideCosts& costs, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  const Stopwatch watch;
  if (report.refitted_cost <= kRotateLimit * report.fresh_cost) {
    static_cast<void>(rotate_wide(blas.wide, costs, pool, cancel));
    report.action = MeshAction::kRotated;
  } else {
    WideCosts fresh = *blas.fresh_costs;
    auto parts = find_spoilt_parts(blas.wide, costs, fresh, kSpoilt);
    if (parts.empty()) parts.push_back(blas.wide.root);  // a little everywhere
    costs = rebuild_parts(blas.wide, fresh, parts, blas.config, pool, cancel);
    blas.fresh_costs = std::make_shared<const WideCosts>(std::move(fresh));
    report.action = MeshAction::kPartlyRebuilt;
  }
  blas.shape = new_tree_shape();
  report.mend_milliseconds = watch.milliseconds();
  report.cost = costs.whole(blas.wide);
  report.reason =
      "positions changed, and a ray through the refitted tree cost " + times(report.refitted_cost, report.fresh_cost);
}

// From the tree over the same triangles where they were before. False if it cannot be refitted, or the result would be
// too slow to trace.
bool refit(Blas& blas, const Blas& before, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  if (!is_refittable(before.wide)) {
    report.reason = "positions changed, and a tree with spatial splits cannot be refitted";
    return false;
  }
  const Stopwatch watch;
  blas.fresh_costs = before.fresh_costs;
  if (!blas.fresh_costs) {
    blas.fresh_costs = std::make_shared<const WideCosts>(measure_wide_costs(before.wide, pool, cancel));
  }
  report.fresh_cost = blas.fresh_costs->whole(before.wide);
  if (!before.wide.is_empty && !(report.fresh_cost > 0)) {
    report.reason = "positions changed, and the tree was built when the mesh had no extent";
    return false;
  }
  blas.config = before.config;
  SpareTree::Tree spare = blas.spare->take();
  blas.wide = std::move(spare.wide);
  WideCosts costs = refit_wide(before.wide, blas.mesh, blas.wide, spare.shape == before.shape, pool, cancel);
  blas.shape = before.shape;
  report.refit_milliseconds = watch.milliseconds();
  report.refitted_cost = report.cost = costs.whole(blas.wide);
  report.action = MeshAction::kRefitted;
  report.reason = "positions changed";
  if (report.refitted_cost > kRefitLimit * report.fresh_cost) {
    const double most = kMendLimit * report.fresh_cost;
    const bool is_promising = predict_mended_cost(blas.wide, costs, *blas.fresh_costs) <= most;
    if (is_promising) mend(blas, costs, report, pool, cancel);
    if (!is_promising || report.cost > most || blas.wide.depth > kMaxTreeDepth) {
      report.reason = "positions changed, and a ray through a refitted tree would cost " +
                      times(report.refitted_cost, report.fresh_cost);
      return false;
    }
  }
  blas.cover = make_cover(cover_boxes(blas.wide, blas.mesh, kCoverBoxes));
  return true;
}

}  // namespace

Scene::BlasResult Scene::make_blas(std::int32_t mesh_id, const MeshSlot& slot, ThreadPool& pool, CancelToken& cancel) {
  const Stopwatch watch;
  auto blas = std::make_shared<Blas>(slot.edited);
  MeshReport report;
  report.mesh_id = mesh_id;
  report.reason = slot.blas ? "the triangles were replaced" : "new mesh";
  const bool deforms = slot.blas && slot.same_topology;
  if (deforms) blas->spare = slot.spare ? slot.spare : std::make_shared<SpareTree>();
  if (!deforms || !refit(*blas, *slot.blas, report, pool, cancel)) {
    report.action = slot.blas ? MeshAction::kRebuilt : MeshAction::kBuilt;
    blas->fresh_costs.reset();
    blas->config = choose_builder(slot.config, slot.usage);
    report.reason += why_so_built(slot.config.builder, blas->config.builder);
    if (slot.usage == Usage::kChanging && is_built_wide(blas->config)) {
      build_wide(*blas, report, pool, cancel);
    } else {
      build(*blas, report, pool, cancel);
    }
    blas->shape = new_tree_shape();
  }
  report.builder = builder_name(blas->config.builder);
  report.layout = layout_name(blas->config.layout);
  report.triangle_count = blas->mesh.triangle_count();
  blas->indexed_leaves = view_leaves(blas->wide, blas->mesh);
  report.byte_count = blas->mesh.byte_count() + blas->wide.byte_count();
  report.milliseconds = watch.milliseconds();
  return {std::move(blas), std::move(report)};
}

}  // namespace perfect_bvh
