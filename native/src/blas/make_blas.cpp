// From a mesh that is new or was edited to what rays are traced through. Where only positions changed
// the tree is refitted and perhaps restructured (refit_blas.cpp); where they came to rest in a tree that motion
// degraded, that is kept or rebuilt (rest_blas.cpp); otherwise, or where the governor wants another one, a tree is
// built (build_wide_tree.cpp).

#include "blas/make_blas.h"

#include "blas/build_tree.h"
#include "blas/build_wide_tree.h"
#include "blas/choose_tree.h"
#include "blas/ledger.h"
#include "blas/motion_steps.h"
#include "core/stopwatch.h"
#include "update/mesh_shape.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {
namespace {

// Of a builder that was not asked for by name and is not the usual one.
const char* why_so_built(BuilderKind asked, BuilderKind chosen, Usage usage) {
  if (asked != BuilderKind::kAuto || chosen == BuilderKind::kBinned) return "";
  if (chosen == BuilderKind::kSpatial) return "; the rays repay spatial splits";
  return usage == Usage::kChanging ? "; its topology changes, so the fast builder made its tree"
                                   : "; the expected rays repay no more than the fast builder";
}

std::string why_built(const MeshState& state) {
  if (!state.blas) return "new mesh";
  const std::string what = std::string("the ") + kind_name(state.blas->mesh.kind);
  return what + (is_resting(state) ? " rest, and more rays came than their tree was built for" : " were replaced");
}

void build_blas(Blas& blas, const ChangedMesh& changed, const CommitOptions& options, BlasResult& result,
                ThreadPool& pool, CancelToken& cancel) {
  const MeshState& state = *changed.state;
  MeshReport& report = result.report;
  TreeChoice choice = choose_tree(changed, options, cancel);
  if (report.alternatives.empty()) note(report, choice.alternatives);
  blas.config = choice.config;
  const Usage usage = usage_of(state.usage, state.has_deformed);
  report.reason += why_so_built(state.config.builder, blas.config.builder, usage);
  if (blas.mesh.moves()) {
    build_moving_tree(blas, report, pool, cancel);
  } else {
    build_wide_tree(blas, report, pool, cancel);
  }
  blas.shape = new_tree_shape();
  const bool is_of_these = state.same_topology || is_resting(state);  // and not of primitives that were replaced
  const UpdateHistory last = state.has_deformed && is_of_these ? state.history : UpdateHistory{};
  const TraceWork work = measure_trace_work(blas.wide, blas.mesh, cancel);
  report.node_visits = work.node_visits, report.leaf_visits = work.leaf_visits;
  result.history = begin_history(last, work, result.history.sample_now, options.calibration);
}

}  // namespace

BlasResult make_blas(const ChangedMesh& changed, const CommitOptions& options, ThreadPool& pool, CancelToken& cancel) {
  const Stopwatch watch;
  const MeshState& state = *changed.state;
  BlasResult result;
  MeshReport& report = result.report;
  report.mesh_id = changed.mesh_id;
  report.usage = usage_name(state.usage);
  report.expected_rays = changed.rays;
  report.action = state.blas ? MeshAction::kRebuilt : MeshAction::kBuilt;
  report.reason = why_built(state);
  if (is_resting(state) && needs_decision(state, options) && keeps_at_rest(changed, options, result)) return result;
  auto blas = std::make_shared<Blas>(is_resting(state) ? state.blas->owned_mesh : state.edited);
  const bool deforms = state.blas && state.same_topology;
  if (deforms) blas->spare = state.spare ? state.spare : std::make_shared<SpareTree>();
  if (!deforms || !refit_blas(*blas, changed, options, result, pool, cancel)) {
    report.action = state.blas ? MeshAction::kRebuilt : MeshAction::kBuilt;
    blas->fresh_costs.reset();
    blas->built_sah = 0;
    blas->refit_plan = {};
    build_blas(*blas, changed, options, result, pool, cancel);
  }
  report.cost = kWideNodeCost * report.node_visits + kWideLeafCost * report.leaf_visits;
  report.builder = builder_name(blas->config.builder);
  report.kind = kind_name(blas->mesh.kind);
  report.triangle_count = blas->mesh.primitive_count();
  blas->round_leaves = view_leaves(blas->wide, blas->mesh);
  add_motion_steps(*blas, pool, cancel);
  report.byte_count = byte_count(*blas);
  report.milliseconds = watch.milliseconds();
  result.blas = std::move(blas);
  return result;
}

}  // namespace perfect_bvh
