#include "update/governor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace perfect_bvh {
namespace {

// Returns the levels of a tree, relative to those of the measured meshes.
double growth(std::size_t triangle_count) {
  return std::log2(std::max(static_cast<double>(triangle_count), 2.0)) / std::log2(kCalibratedTriangles);
}

// The expected cost of each action, and of a ray after it; by action.
struct Forecast {
  std::array<double, 4> update;
  std::array<double, 4> ray;
};

// Restructuring does not change the leaves: at best, the nodes above them are as good as before.
double restructured_nanoseconds(const UpdateQuestion& question, const Calibration& calibration) {
  const TraceWork best{question.reference.node_visits, question.now.leaf_visits};
  return std::min(ray_nanoseconds(question.now, calibration), ray_nanoseconds(best, calibration));
}

Forecast forecast(const UpdateQuestion& question, const Calibration& calibration) {
  const auto count = static_cast<double>(question.triangle_count);
  const double now = ray_nanoseconds(question.now, calibration);
  const double restructured = restructured_nanoseconds(question, calibration);
  const double refit = count * calibration.refit_nanoseconds;
  // New parts are inserted into a tree that is rewritten for them, which takes as long as a refit.
  const double parts = refit + question.degraded_share * count * calibration.rebuild_parts_nanoseconds;
  return {{refit, refit + count * calibration.rotate_nanoseconds, refit + parts,
           build_nanoseconds(question.triangle_count, question.builder, calibration)},
          {now, now - calibration.rotation_gain * (now - restructured), restructured,
           fresh_nanoseconds(question.history, question.sample, calibration)}};
}

// Returns the saving of removing `excess` in this commit, averaged over the commits since it was removed last: k e(k) -
// (e(1) + ... + e(k-1)).
double gain_of(double excess, const Excess& past) { return (past.commit_count + 1.0) * excess - past.nanoseconds; }

// Compares the loss of rays in the refitted tree with the price of an action, in words; it `pays` or not.
std::string weigh(double lost, UpdateAction action, double price, bool pays) {
  if (!pays && is_next_to_nothing(lost)) {
    return "rays lose too little in the refitted tree to repay a new one (" + as_time(price) + ")";
  }
  return "rays lose " + as_time(lost) + " in the refitted tree, " + (pays ? "enough to " : "too little to ") +
         verb_of(action) + " for " + as_time(price);
}

void decide_by_rays(const UpdateQuestion& question, UpdateDecision& decision, const Forecast& costs) {
  const double rays = *question.rays;
  const UpdateHistory& history = question.history;
  const double to_restructure = gain_of(rays * (costs.ray[0] - costs.ray[2]), history.since_restructuring);
  const double to_build = gain_of(rays * (costs.ray[0] - costs.ray[3]), history.since_build);
  const std::array<double, 4> gains{
      0, to_restructure * (costs.ray[0] - costs.ray[1]) / std::max(costs.ray[0] - costs.ray[2], 1e-300), to_restructure,
      to_build};
  std::size_t best = 0;
  double most = 0;
  for (std::size_t i = 1; i < gains.size(); ++i) {
    const double gain = gains[i] - (costs.update[i] - (i < 3 ? costs.update[0] : 0));
    if (gain > most) most = gain, best = i;
  }
  decision.action = static_cast<UpdateAction>(best);
  const std::size_t named = best == 0 ? 3 : best;
  decision.reason = "positions changed; " + weigh(rays * std::max(costs.ray[0] - costs.ray[named], 0.0),
                                                  static_cast<UpdateAction>(named), costs.update[named], best != 0);
}

// In visits to nodes, like collapsing: decisions that need no machine's numbers do not use them.
double cost_of(const TraceWork& work) { return work.node_visits + 0.5 * work.leaf_visits; }

void decide_by_decay(const UpdateQuestion& question, UpdateDecision& decision) {
  const double now = cost_of(question.now), then = cost_of(question.reference);
  const double restructured = cost_of({question.reference.node_visits, question.now.leaf_visits});
  decision.reason = "positions changed";
  // Restructuring is not repeated in every commit for what it could not repair: an animated mesh would pay each time.
  const double attained = std::max(then, cost_of(question.history.restructured));
  if (now <= kRefitLimit * attained && restructured <= kRestructureLimit * then) return;
  decision.action = restructured > kRestructureLimit * then ? UpdateAction::kRebuild
                    : now <= kRotateLimit * then            ? UpdateAction::kRotate
                                                            : UpdateAction::kRebuildParts;
  decision.reason += ", and a ray through the refitted tree would cost " + with_tenths(now / then) +
                     " times as much as when the tree was built";
}

void remember(UpdateDecision& decision, const UpdateQuestion& question, const Forecast& costs) {
  const double rays = question.rays.value_or(0);
  const double after = costs.ray[static_cast<std::size_t>(decision.action)];
  UpdateHistory& history = decision.history = question.history;
  history.since_build.nanoseconds += rays * (after - costs.ray[3]);
  ++history.since_build.commit_count;
  if (decision.action != UpdateAction::kRefit) {
    history.since_restructuring = {};
  } else {
    history.since_restructuring.nanoseconds += rays * (after - costs.ray[2]);
    ++history.since_restructuring.commit_count;
  }
}

// Returns the share of a builder's measured gain over the binned one that is expected here. Spatial splits lower the
// cost of a ray by 23 to 34 percent on gear wheels (empty-space ratio 7 to 15), 17 on hair (17), 21 on hair in the wind
// (71), 50 to 76 on sticks (32 to 320) and 5 on a tree (5); by 0 to 2 on leaves, roof tiles and statues (1 to 6).
double gain_share(BuilderKind builder, double air) {
  return builder == BuilderKind::kSpatial ? std::clamp((air - 5.0) / 7.0, 0.0, 1.0) : 1.0;
}

// Returns the factor by which building takes longer than measured. If cutting triangles pays off, more of them are cut
// than on the calibration meshes: on those above that took from 1.0 to 4.5 times as long.
double build_share(BuilderKind builder, double air) {
  return builder == BuilderKind::kSpatial ? 1.0 + 1.5 * gain_share(builder, air) : 1.0;
}

// The cost of a ray, on a mesh with as many triangles as the measured ones.
double trace_nanoseconds(BuilderKind builder, double air, const Calibration& calibration) noexcept {
  const double usual = calibration.of(BuilderKind::kBinned).trace_nanoseconds;
  return usual - gain_share(builder, air) * (usual - calibration.of(builder).trace_nanoseconds);
}

}  // namespace

double ray_nanoseconds(const TraceWork& work, const Calibration& calibration) noexcept {
  return work.node_visits * calibration.node_nanoseconds + work.leaf_visits * calibration.leaf_nanoseconds;
}

// The exponent found by a rebuild is trusted less, the more the mesh has changed since.
double fresh_nanoseconds(const UpdateHistory& history, double sample, const Calibration& calibration) noexcept {
  const double then = ray_nanoseconds(history.fresh, calibration);
  if (!(sample > 0 && history.sample > 0)) return then;
  const double change = std::log(sample / history.sample);
  const double known = history.exponent.value_or(1.0);
  const double uncertainty = 0.5 * std::min(1.0, std::abs(change) / std::log(8.0));
  return then * std::exp(change * (known + (1.0 - known) * uncertainty));
}

double build_nanoseconds(std::size_t triangle_count, BuilderKind builder, const Calibration& calibration) noexcept {
  return static_cast<double>(triangle_count) * calibration.of(builder).build_nanoseconds * growth(triangle_count);
}

UpdateHistory begin_history(const UpdateHistory& last, const TraceWork& fresh, double sample,
                            const Calibration& calibration) noexcept {
  UpdateHistory history;
  history.fresh = history.now = fresh, history.sample = history.sample_now = sample;
  history.exponent = last.exponent;
  const double then = ray_nanoseconds(last.fresh, calibration), now = ray_nanoseconds(fresh, calibration);
  if (!(then > 0 && now > 0 && last.sample > 0 && sample > 0)) return history;
  constexpr double kLeastChange = 0.1;  // below it, the exponent would only be noise
  const double change = std::log(sample / last.sample);
  if (std::abs(change) >= kLeastChange) history.exponent = std::clamp(std::log(now / then) / change, 0.5, 2.0);
  return history;
}

bool may_rebuild(const UpdateQuestion& question, const Calibration& calibration) noexcept {
  if (question.policy != Policy::kGoverned || !question.rays) return false;
  const double all = *question.rays * ray_nanoseconds(question.now, calibration);
  return gain_of(all, question.history.since_build) >
         build_nanoseconds(question.triangle_count, question.builder, calibration);
}

bool may_restructure(const UpdateQuestion& question, const Calibration& calibration) noexcept {
  if (question.policy != Policy::kGoverned || !question.rays) return false;
  const double excess = ray_nanoseconds(question.now, calibration) - restructured_nanoseconds(question, calibration);
  return gain_of(*question.rays * excess, question.history.since_restructuring) >
         static_cast<double>(question.triangle_count) * calibration.refit_nanoseconds;
}

UpdateDecision decide_update(const UpdateQuestion& question, const Calibration& calibration) {
  const Forecast costs = forecast(question, calibration);
  UpdateDecision decision;
  for (std::size_t i = 0; i < costs.update.size(); ++i) {
    const auto action = static_cast<UpdateAction>(i);
    decision.alternatives.push_back({action, action == UpdateAction::kRebuild ? question.builder : BuilderKind::kAuto,
                                     costs.update[i], std::nullopt});
    if (question.rays) decision.alternatives.back().trace_nanoseconds = *question.rays * costs.ray[i];
  }
  if (question.triangle_count == 0) {
    decision.reason = "positions changed; the mesh has no primitives that rays can hit";
  } else if (question.policy != Policy::kGoverned) {
    decision.action = static_cast<UpdateAction>(static_cast<std::size_t>(question.policy) - 1);
    decision.reason = std::string("positions changed, and the policy is to ") + verb_of(decision.action) + " always";
  } else if (!(ray_nanoseconds(question.history.fresh, calibration) > 0)) {
    decision.action = UpdateAction::kRebuild;
    decision.reason = "positions changed, and the tree was built when the mesh had no extent";
  } else if (question.rays) {
    decide_by_rays(question, decision, costs);
  } else {
    decide_by_decay(question, decision);
  }
  remember(decision, question, costs);
  return decision;
}

bool is_restructured(const UpdateQuestion& question, const TraceWork& restructured) noexcept {
  if (question.rays || question.policy != Policy::kGoverned) return true;
  return cost_of(restructured) <= kRestructureLimit * cost_of(question.reference);
}

BuildDecision decide_build(const BuildQuestion& question, const Calibration& calibration) {
  BuildDecision decision{question.builders.front(), {}};
  double least = std::numeric_limits<double>::infinity();
  for (const BuilderKind builder : question.builders) {
    const bool is_held = builder == question.held;
    const double build =
        is_held ? 0.0
                : build_share(builder, question.air) * build_nanoseconds(question.triangle_count, builder, calibration);
    const double trace =
        question.rays * trace_nanoseconds(builder, question.air, calibration) * growth(question.triangle_count);
    decision.alternatives.push_back({is_held ? UpdateAction::kKeep : UpdateAction::kRebuild, builder, build, trace});
    if (!(build + trace < least)) continue;
    least = build + trace;
    decision.builder = builder;
  }
  return decision;
}

// Building and tracing grow equally with the levels of a tree.
double repaying_rays(const BuildQuestion& question, const Calibration& calibration) noexcept {
  double fewest = std::numeric_limits<double>::infinity();
  if (!question.held) return fewest;
  const double usual = trace_nanoseconds(*question.held, question.air, calibration);
  for (const BuilderKind builder : question.builders) {
    const double gain = usual - trace_nanoseconds(builder, question.air, calibration);
    if (builder == question.held || !(gain > 0)) continue;
    const double build = static_cast<double>(question.triangle_count) * calibration.of(builder).build_nanoseconds *
                         build_share(builder, question.air);
    fewest = std::min(fewest, build / gain);
  }
  return fewest;
}

// Rest ----------------------------------------------------------------------------------------------------------------

namespace {

// The cost of a fresh tree is not predicted more precisely.
constexpr double kNoticeable = 1.02;

std::string tell(const RestQuestion& question, const Excess& at_rest, double build, double decay) {
  const std::string rest = std::string("the ") + question.what + " rest; ";
  if (!question.rays) {
    return rest + "a ray costs " + with_tenths(decay) +
           " times as much as in a new tree, but the number of expected rays is unknown";
  }
  const std::string commits =
      at_rest.commit_count == 1 ? "1 commit" : std::to_string(at_rest.commit_count) + " commits";
  return rest + "rays have lost " + as_time(at_rest.nanoseconds) + " in " + commits + " of the refitted tree, " +
         (at_rest.nanoseconds > build ? "enough to " : "too little to ") + verb_of(UpdateAction::kRebuild) + " for " +
         as_time(build);
}

}  // namespace

bool is_degraded(const UpdateHistory& history, const Calibration& calibration) noexcept {
  return history.since_build.commit_count > 0 &&
         ray_nanoseconds(history.now, calibration) >
             kNoticeable * fresh_nanoseconds(history, history.sample_now, calibration);
}

UpdateDecision decide_at_rest(const RestQuestion& question, const Calibration& calibration) {
  UpdateDecision decision;
  UpdateHistory& history = decision.history = question.history;
  const double now = ray_nanoseconds(history.now, calibration);
  const double fresh = fresh_nanoseconds(history, history.sample_now, calibration);
  const double build = build_nanoseconds(question.triangle_count, question.builder, calibration);
  decision.alternatives = {{UpdateAction::kKeep, BuilderKind::kAuto, 0, std::nullopt},
                           {UpdateAction::kRebuild, question.builder, build, std::nullopt}};
  if (question.rays) {
    decision.alternatives[0].trace_nanoseconds = *question.rays * now;
    decision.alternatives[1].trace_nanoseconds = *question.rays * fresh;
  }
  const double lost = question.rays.value_or(0) * std::max(now - fresh, 0.0);
  for (Excess* const excess : {&history.at_rest, &history.since_build}) {
    excess->nanoseconds += lost;
    ++excess->commit_count;
  }
  decision.action = history.at_rest.nanoseconds > build ? UpdateAction::kRebuild : UpdateAction::kKeep;
  decision.reason = tell(question, history.at_rest, build, fresh > 0 ? now / fresh : 1.0);
  return decision;
}

}  // namespace perfect_bvh
