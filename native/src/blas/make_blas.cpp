#include "blas/make_blas.h"

#include <array>
#include <limits>
#include <span>
#include <string_view>
#include <utility>

#include "blas/build_tree.h"
#include "blas/moved_mesh.h"
#include "core/cancel.h"
#include "update/governor.h"
#include "update/mesh_shape.h"
#include "wide/wide_bvh.h"
#include "wide/wide_cost.h"
#include "wide/wide_rebuild.h"
#include "wide/wide_refit.h"

namespace perfect_bvh {
namespace {

// The number of commits that a tree is expected to serve. A static mesh's tree serves a whole animation, or a single
// image.
constexpr double kStaticCommits = 4;

// The references added if enough rays are expected for spatial splits to pay off, as a share of the triangles. Copies
// are made only if they lower the cost: almost none for leaves and statues, a few for gear wheels, all of them for
// sticks and hair, whose trees then take up to 3.5 times the bytes.
constexpr float kAmpleBudget = 5.0f;

// From the fastest build to the cheapest rays.
constexpr std::array kByQuality{BuilderKind::kFast, BuilderKind::kBinned, BuilderKind::kSpatial};

// Returns the builders that suit a mesh with this usage. A tree with spatial splits cannot be refitted, and takes long
// to build.
std::span<const BuilderKind> builders_for(Usage usage) noexcept {
  const std::span<const BuilderKind> all(kByQuality);
  if (usage == Usage::kStatic) return all;
  return usage == Usage::kDeforming ? all.subspan(1, 1) : all.first(2);
}

// Returns the builders from `least` on; empty if that is not among them.
std::span<const BuilderKind> builders_from(BuilderKind least, Usage usage) noexcept {
  const std::span<const BuilderKind> all = builders_for(usage);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i] == least) return all.subspan(i);
  }
  return {};
}

bool is_free(const MeshState& state, const CommitOptions& options) noexcept {
  return state.config.builder == BuilderKind::kAuto && options.policy == Policy::kGoverned;
}

bool was_budgeted(const BuildConfig& config) noexcept {
  return config.duplication_budget != BuildConfig().duplication_budget;
}

}  // namespace

double rays_to_come(Usage usage, double rays) noexcept {
  return usage == Usage::kStatic ? rays * kStaticCommits : rays;
}

TreeChoice choose_tree(const ChangedMesh& changed, const CommitOptions& options, CancelToken& cancel) {
  const MeshState& state = *changed.state;
  const Usage usage = usage_of(state.usage, state.has_deformed);
  TreeChoice choice{choose_builder(state.config, usage), {}};
  const double known = changed.rays.value_or(changed.cast_rays);
  if (!is_free(state, options) || !(changed.rays || known > 0)) return choice;
  const bool replaces = is_resting(state) && !state.has_deformed;
  const Mesh& mesh = is_resting(state) ? state.blas->mesh : *state.edited;
  BuildQuestion question{builders_for(usage), mesh.primitive_count(), changed.served_rays + rays_to_come(usage, known),
                         0, std::nullopt};
  if (replaces) {
    question.held = state.blas->config.builder;
    question.builders = builders_from(*question.held, usage);
  } else if (!changed.rays) {
    question.builders = builders_from(choice.config.builder, usage);
    if (question.builders.size() < 2) return choice;
  }
  if (question.builders.back() == BuilderKind::kSpatial) {
    question.air = is_resting(state) && state.air ? *state.air : measure_air(mesh, cancel);
  }
  BuildDecision decision = decide_build(question, options.calibration);
  choice.alternatives = std::move(decision.alternatives);
  if (decision.builder == BuilderKind::kBinned) {
    choice.config = choose_builder(state.config, Usage::kStatic);
  } else {
    choice.config = state.config;
    choice.config.builder = decision.builder;
    const bool is_ample = decision.builder == BuilderKind::kSpatial && !was_budgeted(state.config);
    if (is_ample) choice.config.duplication_budget = kAmpleBudget;
  }
  return choice;
}

double most_rays_of_tree(const MeshState& state, const CommitOptions& options) noexcept {
  constexpr double kNoMatter = std::numeric_limits<double>::infinity();
  if (!is_resting(state) || state.has_deformed || !is_free(state, options)) return kNoMatter;
  const BuilderKind held = state.blas->config.builder;
  const auto builders = builders_from(held, state.usage);
  if (builders.size() < 2) return kNoMatter;
  const double air = state.air.value_or(kNoMatter);
  return repaying_rays({builders, state.blas->mesh.primitive_count(), 0, air, held}, options.calibration);
}

// Make blas -----------------------------------------------------------------------------------------------------------
// Makes the tree that rays are traced through from a mesh that is new or was edited. If only positions changed, the
// tree is refitted and perhaps restructured (refit_blas()). If they came to rest in a tree that motion degraded, the
// tree is kept or rebuilt (rest_blas()). Otherwise, or if the governor decides so, a new tree is built
// (build_tree.cpp).

namespace {

// Returns the reason for a builder that was not requested by name and is not the default.
const char* why_so_built(BuilderKind asked, BuilderKind chosen, Usage usage) {
  if (asked != BuilderKind::kAuto || chosen == BuilderKind::kBinned) return "";
  if (chosen == BuilderKind::kSpatial) return "; the expected rays repay spatial splits";
  return usage == Usage::kChanging ? "; its topology changes, so the fast builder made its tree"
                                   : "; too few rays are expected to repay a slower builder than the fast one";
}

std::string why_built(const MeshState& state) {
  if (!state.blas) return "new mesh";
  const std::string what = std::string("the ") + names_of(state.blas->mesh.kind).kind;
  return what + (is_resting(state) ? " rest, and more rays were cast than their tree was built for" : " were replaced");
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
  blas.shape = new_tree_shape();  // first: if it is aborted, its memory must not pass for that of a refitted tree
  if (blas.mesh.moves()) {
    build_moving_tree(blas, report, pool, cancel);
  } else {
    build_wide_tree(blas, report, pool, cancel);
  }
  const bool is_of_these = state.same_topology || is_resting(state);  // not if the primitives were replaced
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
  report.kind = names_of(blas->mesh.kind).kind;
  report.triangle_count = blas->mesh.primitive_count();
  blas->round_leaves = view_leaves(blas->wide, blas->mesh);
  add_motion_steps(*blas, pool, cancel);
  report.byte_count = byte_count(*blas);
  report.milliseconds = watch.milliseconds();
  result.blas = std::move(blas);
  return result;
}

// Refit blas ----------------------------------------------------------------------------------------------------------
// Refits a tree to its moved triangles. Then the governor decides whether to keep it, to restructure it by rotations or
// new parts, or to build another tree.

namespace {

// A part is degraded if its root's children cover this many times the area that they did.
constexpr double kDegraded = 1.1;

// Returns the work of a tree whose parts' costs are known.
TraceWork work_of(const WideCosts& costs, const WideBvh& tree) {
  if (tree.is_empty) return {};
  const double leaves = costs.of_leaves(tree.root);
  return {(costs.of(tree.root) - leaves) / kWideNodeCost, leaves / kWideLeafCost};
}

// Returns the parts of a refitted tree that its motion degraded, by their roots.
std::vector<std::uint32_t> degraded_parts(const Blas& blas, const WideCosts& costs, CancelToken& cancel) {
  auto parts = find_degraded_parts(blas.wide, costs, *blas.fresh_costs, kDegraded, cancel);
  if (parts.empty() && blas.wide.root < kBlockChild) parts.push_back(blas.wide.root);  // a little everywhere
  return parts;
}

// Returns why a tree cannot be refitted; empty if it can.
std::string_view why_not_refitted(const Blas& before, Policy policy) {
  if (!is_refittable(before.wide)) return "positions changed, and a tree with spatial splits cannot be refitted";
  return policy == Policy::kRebuild ? "positions changed, and the policy is to rebuild always" : "";
}

// Refits the tree of `before` to the present triangles of `blas`.
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

// Returns the share of the leaves that are now in other parts of the tree.
double restructure(Blas& blas, UpdateAction action, WideCosts& costs, ThreadPool& pool, CancelToken& cancel) {
  blas.refit_plan.order.reset();
  blas.shape = new_tree_shape();  // first: if it is aborted, its memory must not pass for the old shape's
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

// Measures further inputs of the governor's decision, if they can make a difference.
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

  const Stopwatch watch;  // of restructuring, and of the decision for it
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

// Rest blas -----------------------------------------------------------------------------------------------------------
// Decides whether a mesh that moved earlier and now rests keeps the tree that its motion degraded.

bool needs_decision(const MeshState& state, const CommitOptions& options) noexcept {
  if (!is_resting(state)) return true;
  return options.policy == Policy::kGoverned && is_degraded(state.history, options.calibration);
}

bool keeps_at_rest(const ChangedMesh& resting, const CommitOptions& options, BlasResult& result) {
  const MeshState& state = *resting.state;
  const Blas& blas = *state.blas;
  UpdateDecision decision =
      decide_at_rest({.triangle_count = blas.mesh.primitive_count(),
                      .what = names_of(blas.mesh.kind).kind,
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
  report.kind = names_of(blas.mesh.kind).kind;
  report.triangle_count = blas.mesh.primitive_count();
  report.byte_count = byte_count(blas);
  return true;
}

}  // namespace perfect_bvh
