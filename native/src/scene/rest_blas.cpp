// Scene::keeps_at_rest: of a mesh that moved once and rests now in a tree that its motion spoilt, whether it keeps it.

#include "scene/blas_build.h"
#include "scene/ledger.h"
#include "scene/scene.h"
#include "scene/tree_bytes.h"
#include "update/rest.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {

bool Scene::is_resting(const MeshSlot& slot) noexcept { return slot.edited == nullptr; }

bool Scene::needs_decision(const MeshSlot& slot, const CommitOptions& options) noexcept {
  if (!is_resting(slot)) return true;
  return options.policy == Policy::kGoverned && slot.blas && !slot.blas->deferred &&
         is_spoilt(slot.history, options.calibration);
}

// False if another tree is to be built. Fills in all of the result but a new tree's part.
bool Scene::keeps_at_rest(const ChangedMesh& resting, const CommitOptions& options, BlasResult& result) {
  const MeshSlot& slot = *resting.slot;
  const Blas& blas = *slot.blas;
  UpdateDecision decision = decide_at_rest({.triangle_count = blas.mesh.triangle_count(),
                                            .builder = choose_builder(slot.config, usage_of(slot.usage, true)).builder,
                                            .rays = resting.rays,
                                            .history = slot.history},
                                           options.calibration);
  MeshReport& report = result.report;
  report.action = action_of(decision.action);
  report.reason = std::move(decision.reason);
  note(report, decision.alternatives);
  result.history = decision.history;
  if (decision.action == UpdateAction::kRebuild) return false;
  report.node_visits = slot.history.now.node_visits, report.leaf_visits = slot.history.now.leaf_visits;
  report.cost = kWideNodeCost * report.node_visits + kWideLeafCost * report.leaf_visits;
  report.builder = builder_name(blas.config.builder);
  report.layout = layout_name(blas.config.layout);
  report.triangle_count = blas.mesh.triangle_count();
  report.byte_count = byte_count(blas);
  return true;
}

}  // namespace perfect_bvh
