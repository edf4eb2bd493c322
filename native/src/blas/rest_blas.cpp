// Whether a mesh that moved once and rests now keeps the tree that its motion degraded.

#include "blas/build_tree.h"
#include "blas/ledger.h"
#include "blas/make_blas.h"
#include "update/rest.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {

bool needs_decision(const MeshState& state, const CommitOptions& options) noexcept {
  if (!is_resting(state)) return true;
  return options.policy == Policy::kGoverned && is_degraded(state.history, options.calibration);
}

bool keeps_at_rest(const ChangedMesh& resting, const CommitOptions& options, BlasResult& result) {
  const MeshState& state = *resting.state;
  const Blas& blas = *state.blas;
  UpdateDecision decision =
      decide_at_rest({.triangle_count = blas.mesh.primitive_count(),
                      .what = kind_name(blas.mesh.kind),
                      .builder = choose_builder(state.config, usage_of(state.usage, true)).builder,
                      .rays = resting.rays,
                      .history = state.history},
                     options.calibration);
  MeshReport& report = result.report;
  report.action = action_of(decision.action);
  report.reason = std::move(decision.reason);
  note(report, decision.alternatives);
  result.history = decision.history;
  if (decision.action == UpdateAction::kRebuild) return false;
  report.node_visits = state.history.now.node_visits, report.leaf_visits = state.history.now.leaf_visits;
  report.cost = kWideNodeCost * report.node_visits + kWideLeafCost * report.leaf_visits;
  report.builder = builder_name(blas.config.builder);
  report.kind = kind_name(blas.mesh.kind);
  report.triangle_count = blas.mesh.primitive_count();
  report.byte_count = byte_count(blas);
  return true;
}

}  // namespace perfect_bvh
