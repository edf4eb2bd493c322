// From a mesh that is new or was edited to what rays are traced through. Where only positions changed
// the tree is refitted and perhaps restructured (refit_blas.cpp); where they came to rest in a tree that motion
// degraded, that is kept or rebuilt (rest_blas.cpp); otherwise, or where the governor wants another one, a tree is
// built (build_wide_tree.cpp).

#include "blas/make_blas.h"

#include "blas/build_tree.h"
#include "blas/build_wide_tree.h"
#include "blas/ledger.h"
#include "core/stopwatch.h"
#include "update/mesh_shape.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {
namespace {

// Of a builder that was not asked for by name and is not the usual one.
const char* why_so_built(BuilderKind asked, BuilderKind chosen, Usage usage) {
  if (asked != BuilderKind::kAuto || chosen == BuilderKind::kBinned) return "";
  if (chosen == BuilderKind::kSpatial) return "; the expected rays repay spatial splits";
  return usage == Usage::kChanging ? "; its topology changes, so the fast builder made its tree"
                                   : "; the expected rays repay no more than the fast builder";
}

// How many commits a tree is expected to serve: one of a still mesh serves a whole animation, or a single picture.
constexpr double kStaticCommits = 4;

// What will do for a mesh of this kind, where the choice is left to the engine and the rays are known.
std::span<const BuilderKind> builders_for(Usage usage) {
  static constexpr BuilderKind kStatic[] = {BuilderKind::kFast, BuilderKind::kBinned, BuilderKind::kSpatial};
  static constexpr BuilderKind kDeforming[] = {BuilderKind::kBinned};
  static constexpr BuilderKind kChanging[] = {BuilderKind::kFast, BuilderKind::kBinned};
  if (usage == Usage::kStatic) return kStatic;
  return usage == Usage::kDeforming ? std::span<const BuilderKind>(kDeforming) : kChanging;
}

void build_blas(Blas& blas, const ChangedMesh& changed, const CommitOptions& options, BlasResult& result,
                ThreadPool& pool, CancelToken& cancel) {
  const MeshState& state = *changed.state;
  MeshReport& report = result.report;
  const bool deforms = is_resting(state) || (state.blas && state.same_topology);
  const Usage usage = usage_of(state.usage, deforms);
  BuildConfig config = choose_builder(state.config, usage);
  if (state.config.builder == BuilderKind::kAuto && changed.rays && options.policy == Policy::kGoverned) {
    const double commits = usage == Usage::kStatic ? kStaticCommits : 1;
    const double density = measure_density(blas.mesh, cancel);
    const BuildDecision decision = decide_build(
        {builders_for(usage), blas.mesh.triangle_count(), *changed.rays * commits, density}, options.calibration);
    if (report.alternatives.empty()) note(report, decision.alternatives);
    if (decision.builder == BuilderKind::kBinned) {
      config = choose_builder(state.config, Usage::kStatic);
    } else {
      config = state.config;
      config.builder = decision.builder;
    }
  }
  blas.config = config;
  report.reason += why_so_built(state.config.builder, config.builder, usage);
  build_wide_tree(blas, report, pool, cancel);
  blas.shape = new_tree_shape();
  const UpdateHistory last = deforms ? state.history : UpdateHistory{};
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
  report.reason = state.blas ? "the triangles were replaced" : "new mesh";
  if (is_resting(state) && keeps_at_rest(changed, options, result)) return result;
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
  report.layout = layout_name(blas->config.layout);
  report.triangle_count = blas->mesh.triangle_count();
  blas->indexed_leaves = view_leaves(blas->wide, blas->mesh);
  report.byte_count = byte_count(*blas);
  report.milliseconds = watch.milliseconds();
  result.blas = std::move(blas);
  return result;
}

}  // namespace perfect_bvh
