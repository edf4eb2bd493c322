#include "update/rest.h"

#include <algorithm>

#include "update/wording.h"

namespace perfect_bvh {
namespace {

// What a fresh tree costs is predicted no better than this.
constexpr double kNoticeable = 1.02;

std::string tell(const RestQuestion& question, const Excess& at_rest, double build, double decay) {
  const std::string rest = std::string("the ") + question.what + " rest; ";
  if (!question.rays) {
    return rest + "a ray costs " + with_tenths(decay) +
           " times what it would in a new tree, but the number of expected rays is unknown";
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
