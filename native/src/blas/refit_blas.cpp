// A tree that follows its triangles. It is refitted; then the governor decides whether to keep that,
// whether to restructure it by rotations or new parts, or to build another tree.

#include <string_view>

#include "blas/build_tree.h"
#include "blas/ledger.h"
#include "blas/make_blas.h"
#include "core/stopwatch.h"
#include "update/mesh_shape.h"
#include "wide/wide_boxes.h"
#include "wide/wide_cost.h"
#include "wide/wide_rebuild.h"
#include "wide/wide_refit.h"
#include "wide/wide_rotation.h"

namespace perfect_bvh {
namespace {

// A part is degraded where its root's children cover so much more than they did.
constexpr double kDegraded = 1.1;

// Of a tree whose parts' costs are known.
TraceWork work_of(const WideCosts& costs, const WideBvh& tree) {
  if (tree.is_empty) return {};
  const double leaves = costs.of_leaves(tree.root);
  return {(costs.of(tree.root) - leaves) / kWideNodeCost, leaves / kWideLeafCost};
}

// The parts of a refitted tree that its motion degraded, by their roots.
std::vector<std::uint32_t> degraded_parts(const Blas& blas, const WideCosts& costs, CancelToken& cancel) {
  auto parts = find_degraded_parts(blas.wide, costs, *blas.fresh_costs, kDegraded, cancel);
  if (parts.empty() && blas.wide.root < kBlockChild) parts.push_back(blas.wide.root);  // a little everywhere
  return parts;
}

// Why a tree cannot follow at all; empty if it can.
std::string_view why_not_refitted(const Blas& before, Policy policy) {
  if (!is_refittable(before.wide)) return "positions changed, and a tree with spatial splits cannot be refitted";
  return policy == Policy::kRebuild ? "positions changed, and the policy is to rebuild always" : "";
}

// Makes the tree of `before` the tree of `blas`, whose triangles are where they are now.
WideCosts follow(Blas& blas, const Blas& before, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  const Stopwatch watch;
  blas.fresh_costs = before.fresh_costs;
  if (!blas.fresh_costs) {
    blas.fresh_costs = std::make_shared<const WideCosts>(measure_wide_costs(before.wide, pool, cancel));
  }
  blas.built_sah = before.built_sah > 0 ? before.built_sah : measure_sah(before.wide, before.mesh, cancel);
  report.fresh_cost = blas.fresh_costs->whole(before.wide);
  blas.config = before.config;
  ShapedTree spare = blas.spare->take();
  blas.wide = std::move(spare.wide);
  blas.refit_plan = before.refit_plan;
  complete_plan(blas.refit_plan, before.wide, blas.mesh, pool, cancel);
  const bool has_shape = spare.shape == before.shape;
  WideCosts costs = refit_wide(before.wide, blas.refit_plan, blas.mesh, blas.wide, has_shape, pool, cancel);
  blas.shape = before.shape;
  report.refit_milliseconds = watch.milliseconds();
  report.refitted_cost = costs.whole(blas.wide);
  return costs;
}

// Returns which share of the leaves now stands in other parts of the tree.
double restructure(Blas& blas, UpdateAction action, WideCosts& costs, ThreadPool& pool, CancelToken& cancel) {
  blas.refit_plan.order.reset();
  blas.shape = new_tree_shape();  // first: stopped half-way, its memory must not pass for the old shape's
  if (action == UpdateAction::kRotate) {
    static_cast<void>(rotate_wide(blas.wide, costs, pool, cancel));
    return 0;
  }
  WideCosts fresh = *blas.fresh_costs;
  const auto parts = degraded_parts(blas, costs, cancel);
  const double share = share_of_leaves(blas.wide, parts, cancel);
  costs = rebuild_parts(blas.wide, fresh, parts, blas.config, pool, cancel);
  blas.fresh_costs = std::make_shared<const WideCosts>(std::move(fresh));
  return share;
}

// What the governor wants to know beyond costs, where it can make a difference.
void look_closer(UpdateQuestion& question, const Blas& before, const Blas& blas, const WideCosts& costs,
                 const Calibration& calibration, ThreadPool& pool, CancelToken& cancel) {
  const bool knows_rays = question.policy == Policy::kGoverned && question.rays;
  UpdateHistory& history = question.history;
  if (knows_rays && history.since_build.commit_count == 0 && !(history.sample > 0)) {
    history.sample = measure_tree_sample(before.mesh, pool);  // of the shape that the tree was built for
  }
  if (may_rebuild(question, calibration)) question.sample = measure_tree_sample(blas.mesh, pool);
  if (may_restructure(question, calibration)) {
    question.degraded_share = share_of_leaves(blas.wide, degraded_parts(blas, costs, cancel), cancel);
  }
}

}  // namespace

bool refit_blas(Blas& blas, const ChangedMesh& changed, const CommitOptions& options, BlasResult& result,
                ThreadPool& pool, CancelToken& cancel) {
  const Blas& before = *changed.state->blas;
  MeshReport& report = result.report;
  report.reason = why_not_refitted(before, options.policy);
  if (!report.reason.empty()) return false;
  WideCosts costs = follow(blas, before, report, pool, cancel);

  const Stopwatch watch;  // of restructuring, and of finding out whether to
  const Usage usage = usage_of(changed.state->usage, true);
  UpdateQuestion question{.policy = options.policy,
                          .triangle_count = blas.mesh.primitive_count(),
                          .builder = choose_builder(changed.state->config, usage).builder,
                          .rays = changed.rays,
                          .now = work_of(costs, blas.wide),
                          .reference = work_of(*blas.fresh_costs, before.wide),
                          .history = changed.state->history};
  look_closer(question, before, blas, costs, options.calibration, pool, cancel);
  const UpdateDecision decision = decide_update(question, options.calibration);
  report.reason = decision.reason;
  report.action = action_of(decision.action);
  note(report, decision.alternatives);
  result.history = decision.history;
  result.history.sample_now = question.sample;
  if (decision.action == UpdateAction::kRebuild) return false;
  if (decision.action != UpdateAction::kRefit) {
    report.restructured_share = restructure(blas, decision.action, costs, pool, cancel);
    report.restructure_milliseconds = watch.milliseconds();
    if (blas.wide.depth > kMaxTreeDepth || !is_restructured(question, work_of(costs, blas.wide))) {
      report.reason += ", and restructuring did not help";
      return false;
    }
  }
  const TraceWork work = work_of(costs, blas.wide);
  report.node_visits = work.node_visits, report.leaf_visits = work.leaf_visits;
  blas.box = mesh_bounds_of(blas.wide, blas.mesh);
  result.history.now = work, result.history.at_rest = {};
  if (decision.action != UpdateAction::kRefit) result.history.restructured = work;
  return true;
}

}  // namespace perfect_bvh
