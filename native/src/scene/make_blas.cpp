// Scene::make_blas: from a mesh that is new or was edited to what rays are traced through. The binary tree is built or,
// where the triangles are those that it was built over, refitted; then collapsed into the wide one. Of a mesh
// whose topology changes the wide tree is built at once.

#include <algorithm>
#include <limits>

#include "build/optimize.h"
#include "core/stopwatch.h"
#include "scene/blas_build.h"
#include "scene/cover.h"
#include "scene/scene.h"
#include "scene/trace_view.h"
#include "update/quality.h"
#include "update/refit.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"

namespace perfect_bvh {
namespace {

// A refitted tree is kept while a ray is expected to cost at most this much more than when the tree was built.
constexpr double kRefitLimit = 1.5;

std::string why_not_refitted(double cost, double fresh_cost) {
  if (!(fresh_cost > 0)) return "positions changed, and the tree was built when the mesh had no extent";
  const auto tenths = static_cast<long>(std::min(cost / fresh_cost, 1e6) * 10.0 + 0.5);
  return "a refitted tree would cost " + std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) +
         " times what it did when built";
}

const char* why_no_tree_to_refit(const TreeQuality& quality) {
  return !quality.is_refittable
             ? "positions changed, and a tree with spatial splits cannot be refitted"
             : "positions changed, and there was no tree to refit: only those of deforming meshes are kept";
}

const char* why_so_built(BuilderKind asked, BuilderKind chosen) {
  const bool is_for_speed = asked == BuilderKind::kAuto && chosen == BuilderKind::kFast;
  return is_for_speed ? "; its topology changes, so the fast builder made its tree" : "";
}

void build(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  Stopwatch watch;
  BuildConfig unoptimized = blas.config;
  unoptimized.optimize_passes = 0;
  blas.tree = build_tree(blas.mesh, unoptimized, pool, cancel);
  report.build_milliseconds = watch.lap_milliseconds();
  if (blas.config.optimize_passes == 0) return;
  const OptimizeBudget budget{blas.config.optimize_passes, blas.config.optimize_milliseconds};
  // From now on the settings are those that make this very tree again, however long that takes.
  blas.config.optimize_passes = optimize_bvh2(blas.tree, budget, pool, cancel).passes;
  blas.config.optimize_milliseconds = std::numeric_limits<double>::infinity();
  report.optimize_milliseconds = watch.lap_milliseconds();
}

void build_wide(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  const Stopwatch watch;
  blas.wide = build_fast_wide(blas.mesh, blas.config.layout, pool, cancel);
  blas.cover = make_cover(cover_boxes(blas.wide, blas.mesh, kCoverBoxes));
  report.build_milliseconds = watch.milliseconds();
}

void collapse(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  blas.cover = make_cover(blas.tree);
  const Stopwatch watch;
  blas.wide = collapse_mesh(blas.tree, blas.mesh, blas.config.layout, pool, cancel);
  report.collapse_milliseconds = watch.milliseconds();
}

}  // namespace

// A refit from `slot.blas`; false if there is nothing to refit, or the result would be too slow to trace.
bool Scene::refit_blas(Blas& blas, const MeshSlot& slot, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  const Blas& before = *slot.blas;
  if (before.tree.empty() || !before.tree.refittable) {
    report.reason = why_no_tree_to_refit(before.quality);
    return false;
  }
  const Stopwatch watch;
  blas.tree = before.tree;
  refit_bvh2(blas.tree, blas.mesh.positions, blas.mesh.triangles, pool, cancel);
  report.refit_milliseconds = watch.milliseconds();
  blas.quality = measure_quality(blas.tree);
  if (!(blas.quality.sah <= kRefitLimit * slot.fresh_cost)) {
    report.reason = why_not_refitted(blas.quality.sah, slot.fresh_cost);
    return false;
  }
  blas.config = before.config;
  report.action = MeshAction::kRefitted;
  report.reason = "positions changed";
  return true;
}

Scene::BlasResult Scene::make_blas(std::int32_t mesh_id, const MeshSlot& slot, ThreadPool& pool, CancelToken& cancel) {
  const Stopwatch watch;
  BlasResult result;
  auto blas = std::make_shared<Blas>(slot.edited);
  MeshReport& report = result.report;
  report.mesh_id = mesh_id;
  report.action = slot.blas ? MeshAction::kRebuilt : MeshAction::kBuilt;
  report.reason = slot.blas ? "the triangles were replaced" : "new mesh";
  const bool deforms = slot.blas && slot.same_topology;
  // Whoever changed the positions once will do so again.
  const bool keeps_tree = slot.usage == Usage::kDeforming || deforms || (slot.blas && !slot.blas->tree.empty());
  if (deforms && refit_blas(*blas, slot, report, pool, cancel)) {
    result.fresh_cost = slot.fresh_cost;
  } else {
    blas->config = choose_builder(slot.config, slot.usage);
    report.reason += why_so_built(slot.config.builder, blas->config.builder);
    if (slot.usage == Usage::kChanging && !keeps_tree && is_built_wide(blas->config)) {
      build_wide(*blas, report, pool, cancel);
    } else {
      build(*blas, report, pool, cancel);
      blas->quality = measure_quality(blas->tree);
      // A tree built over no extent has no quality to measure a refit by.
      result.fresh_cost = blas->tree.bounds().half_area() > 0 ? blas->quality.sah : 0;
    }
  }
  report.builder = builder_name(blas->config.builder);
  report.layout = layout_name(blas->config.layout);
  report.triangle_count = blas->mesh.triangle_count();
  if (!blas->tree.empty()) collapse(*blas, report, pool, cancel);
  blas->indexed_leaves = view_leaves(blas->wide, blas->mesh);
  if (!keeps_tree || !blas->tree.refittable) blas->tree = {};
  report.byte_count = blas->mesh.byte_count() + blas->tree.byte_count() + blas->wide.byte_count();
  report.milliseconds = watch.milliseconds();
  result.blas = std::move(blas);
  return result;
}

}  // namespace perfect_bvh
