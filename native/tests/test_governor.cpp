// Decisions between refitting and rebuilding: pure functions of their input.
#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "tests/calibrations.h"
#include "update/governor.h"

namespace perfect_bvh::test {
namespace {

UpdateHistory fresh_history(double node_visits, double leaf_visits) {
  UpdateHistory history;
  history.fresh = {node_visits, leaf_visits};
  return history;
}

UpdateQuestion question(double rays, double decay, UpdateHistory history = fresh_history(10, 4)) {
  UpdateQuestion asked;
  asked.triangle_count = 65536;
  asked.rays = rays;
  asked.now = {10 * decay, 4 * decay};
  asked.reference = asked.now;  // nothing to restructure: the leaves cause the cost
  asked.history = history;
  return asked;
}

UpdateAction decide(const UpdateQuestion& asked) { return decide_update(asked, machine()).action; }

TEST(Governor, MoreRaysNeverTurnARebuildIntoARefit) {
  for (const double decay : {0.8, 1.0, 1.01, 1.1, 2.0, 50.0}) {
    bool rebuilds = false;
    for (double rays = 1; rays < 1e12; rays *= 1.5) {
      const bool now = decide(question(rays, decay)) == UpdateAction::kRebuild;
      EXPECT_GE(now, rebuilds) << decay << " " << rays;
      rebuilds = now;
    }
    EXPECT_EQ(rebuilds, decay > 1) << decay;
  }
}

TEST(Governor, WorseTreesAreNeverRefittedWhereBetterOnesAreRebuilt) {
  bool rebuilds = false;
  for (double decay = 0.5; decay < 100; decay *= 1.05) {
    const bool now = decide(question(1e6, decay)) == UpdateAction::kRebuild;
    EXPECT_GE(now, rebuilds) << decay;
    rebuilds = now;
  }
  EXPECT_TRUE(rebuilds);
}

// The excess grows by the same amount in each frame: the mean cost per frame is least at k = sqrt(2 rebuild / growth).
TEST(Governor, RebuildsWhereTheMeanCostOfAFrameIsLeast) {
  const Calibration calibration = machine();
  const double rebuild = build_nanoseconds(65536, BuilderKind::kBinned, calibration);
  for (const double frames : {4.0, 9.0, 30.0}) {
    const double growth = 2 * rebuild / (frames * frames);
    UpdateHistory history = fresh_history(10, 4);
    int count = 0;
    for (UpdateDecision decision; decision.action == UpdateAction::kRefit; ++count) {
      UpdateQuestion asked = question(1e6, 1, history);
      asked.now.node_visits += growth * (count + 1) / 1e6 / calibration.node_nanoseconds;
      asked.reference = asked.now;
      decision = decide_update(asked, calibration);
      history = decision.history;
    }
    EXPECT_NEAR(count, frames, 1.0);
  }
}

TEST(Governor, ATreeThatIsNoWorseIsKeptForEver) {
  UpdateHistory history = fresh_history(10, 4);
  for (int frame = 0; frame < 1000; ++frame) {
    const UpdateDecision decision = decide_update(question(1e9, 1, history), machine());
    ASSERT_EQ(decision.action, UpdateAction::kRefit);
    history = decision.history;
  }
  EXPECT_EQ(history.since_build.commit_count, 1000u);
}

TEST(Governor, WithoutExpectedRaysTheDecayDecides) {
  const auto decide_by = [](double nodes, double leaves) {
    UpdateQuestion asked = question(0, 1);
    asked.rays.reset();
    asked.now = {10 * nodes, 4 * leaves}, asked.reference = {10, 4};
    const UpdateDecision decision = decide_update(asked, machine());
    for (const Alternative& row : decision.alternatives) EXPECT_FALSE(row.trace_nanoseconds);
    return decision.action;
  };
  EXPECT_EQ(decide_by(1.04, 1.04), UpdateAction::kRefit);
  EXPECT_EQ(decide_by(1.15, 1.15), UpdateAction::kRotate);
  EXPECT_EQ(decide_by(2.00, 1.15), UpdateAction::kRebuildParts);
  EXPECT_EQ(decide_by(1.00, 3.00), UpdateAction::kRebuild);
  UpdateQuestion asked = question(0, 1);
  asked.reference = {10, 4};
  EXPECT_TRUE(is_restructured(asked, {100, 4}));  // with a known number of rays it was decided before
  asked.rays.reset();
  EXPECT_TRUE(is_restructured(asked, {12, 4}));
  EXPECT_FALSE(is_restructured(asked, {15, 4}));
}

// An animated mesh is restructured when it gets worse again, not because it was restructured before.
TEST(Governor, WithoutExpectedRaysWhatWasRestructuredIsRestructuredAgainOnlyAfterMoreDecay) {
  UpdateHistory history = fresh_history(10, 4);
  int restructured = 0, rebuilt = 0;
  for (int frame = 0; frame < 200; ++frame) {
    UpdateQuestion asked = question(0, 1, history);
    asked.rays.reset();
    const double decay = 1.1 + 0.03 * std::sin(frame);  // rotations remove a fifth of it
    asked.now = {10 * decay, 4 * decay}, asked.reference = {10, 4};
    const UpdateDecision decision = decide_update(asked, machine());
    history = decision.history;
    if (decision.action == UpdateAction::kRotate) {
      ++restructured;
      history.restructured = {10 + 0.8 * (asked.now.node_visits - 10), asked.now.leaf_visits};
    }
    rebuilt += decision.action == UpdateAction::kRebuild ? 1 : 0;
  }
  EXPECT_GE(restructured, 1);
  EXPECT_LE(restructured, 2);
  EXPECT_EQ(rebuilt, 0);
  UpdateQuestion asked = question(0, 1, history);
  asked.rays.reset();
  asked.now = {11.8, 4.7}, asked.reference = {10, 4};  // worse again
  EXPECT_EQ(decide(asked), UpdateAction::kRotate);
  asked.now = {10, 12}, asked.reference = {10, 4};  // no restructuring helps, even if it helped before
  asked.history.restructured = asked.now;
  EXPECT_EQ(decide(asked), UpdateAction::kRebuild);
}

// If the nodes cause the cost and not the leaves, restructuring gains as much as a rebuild, for less.
TEST(Governor, RestructuresWhatRestructuringCanRestore) {
  UpdateAction last = UpdateAction::kRefit;
  for (double rays = 1; rays < 1e9; rays *= 1.2) {
    UpdateQuestion asked = question(rays, 1);
    asked.now = {15, 4}, asked.reference = {10, 4};
    const UpdateAction action = decide(asked);
    EXPECT_GE(action, last) << rays;
    EXPECT_NE(action, UpdateAction::kRebuild) << rays;
    last = action;
  }
  EXPECT_EQ(last, UpdateAction::kRebuildParts);
}

// If only a small part is degraded, it is restructured for fewer rays.
TEST(Governor, PricesRestructuringByWhatItWouldBuild) {
  double last = 0;
  for (const double share : {0.0, 0.01, 0.3, 1.0}) {
    UpdateQuestion asked = question(1, 1);
    asked.now = {15, 4}, asked.reference = {10, 4}, asked.degraded_share = share;
    asked.history.fresh = asked.now;  // no rebuild gains anything
    const double price = decide_update(asked, machine()).alternatives[2].update_nanoseconds;
    EXPECT_DOUBLE_EQ(price, 65536 * (20 + 60 * share));
    double rays = 1;
    while (decide(asked) != UpdateAction::kRebuildParts && rays < 1e9) asked.rays = rays *= 1.01;
    EXPECT_GT(rays, last) << share;
    EXPECT_LT(rays, 1e9) << share;
    EXPECT_TRUE(may_restructure(asked, machine()));
    last = rays;
  }
}

// Measurements that no decision needs are not made; every action that changes the tree was allowed before.
TEST(Governor, LooksCloserOnlyWhereItMayMatter) {
  bool was = false;
  for (double rays = 1; rays < 1e9; rays *= 1.5) {
    const UpdateQuestion asked = question(rays, 2);
    EXPECT_GE(may_rebuild(asked, machine()), was) << rays;
    was = may_rebuild(asked, machine());
    if (decide(asked) == UpdateAction::kRebuild) {
      EXPECT_TRUE(was) << rays;
    }
  }
  EXPECT_TRUE(was);
  UpdateQuestion asked = question(1e9, 2);
  asked.policy = Policy::kRefit;
  EXPECT_FALSE(may_rebuild(asked, machine()) || may_restructure(asked, machine()));
  asked = question(1e9, 2);
  asked.rays.reset();
  EXPECT_FALSE(may_rebuild(asked, machine()) || may_restructure(asked, machine()));
}

TEST(Governor, ATreeWithoutExtentIsRebuilt) {
  for (const bool knows_rays : {false, true}) {
    UpdateQuestion asked = question(1, 1, fresh_history(0, 0));
    if (!knows_rays) asked.rays.reset();
    EXPECT_EQ(decide(asked), UpdateAction::kRebuild);
  }
}

// A fresh tree is expected to cost as much as the last one times sample^exponent; a rebuild measures the exponent.
TEST(Governor, LearnsWhatAFreshTreeWouldCost) {
  const Calibration calibration = machine();
  const UpdateHistory first = begin_history({}, {10, 4}, 2, calibration);
  EXPECT_FALSE(first.exponent);
  UpdateQuestion asked = question(1e6, 0.75, first);
  asked.sample = 1;  // half the last sample: a fresh tree should cost half
  const double trace = *decide_update(asked, calibration).alternatives[3].trace_nanoseconds;
  EXPECT_DOUBLE_EQ(trace, 1e6 * 260 / 2);
  const double root = std::sqrt(0.5);
  const UpdateHistory second = begin_history(first, {10 * root, 4 * root}, 1, calibration);
  EXPECT_NEAR(*second.exponent, 0.5, 1e-12);
  EXPECT_EQ(second.since_build.commit_count, 0u);
  EXPECT_EQ(begin_history(second, {20, 8}, 0.5, calibration).exponent, 0.5);  // dearer, though the sample is not
  EXPECT_EQ(begin_history(second, {1, 1}, 0.5, calibration).exponent, 2);     // far cheaper
  EXPECT_EQ(begin_history(second, {1, 1}, 1.05, calibration).exponent, second.exponent);  // hardly any change
  EXPECT_EQ(begin_history(second, {1, 1}, 0, calibration).exponent, second.exponent);
}

TEST(Governor, MoreRaysNeverTakeAWorseBuilder) {
  const Calibration calibration = machine();
  constexpr BuilderKind kBuilders[] = {BuilderKind::kFast, BuilderKind::kBinned, BuilderKind::kSpatial};
  for (const double air : {0.0, 5.0, 9.0, 20.0}) {
    double last = 1e9;
    for (double rays = 0; rays < 1e12; rays = rays * 2 + 1) {
      const BuildDecision decision = decide_build({kBuilders, 100000, rays, air}, calibration);
      ASSERT_EQ(decision.alternatives.size(), 3u);
      double trace = 0;
      for (const Alternative& row : decision.alternatives) {
        if (row.builder == decision.builder) trace = *row.trace_nanoseconds / std::max(rays, 1.0);
      }
      if (rays > 0) {
        EXPECT_LE(trace, last * (1 + 1e-12)) << air << " " << rays;
        last = trace;
      }
    }
    EXPECT_EQ(decide_build({kBuilders, 100000, 0, air}, calibration).builder, BuilderKind::kFast);
    EXPECT_EQ(decide_build({kBuilders, 100000, 1e12, air}, calibration).builder,
              air > 6 ? BuilderKind::kSpatial : BuilderKind::kBinned);
  }
}

TEST(Governor, PoliciesDecideRegardless) {
  for (const double decay : {1.0, 100.0}) {
    UpdateQuestion asked = question(1e9, decay);
    asked.policy = Policy::kRefit;
    EXPECT_EQ(decide(asked), UpdateAction::kRefit);
    asked.policy = Policy::kRotate;
    EXPECT_EQ(decide(asked), UpdateAction::kRotate);
    asked.policy = Policy::kRebuildParts;
    EXPECT_EQ(decide(asked), UpdateAction::kRebuildParts);
    asked.policy = Policy::kRebuild;
    EXPECT_EQ(decide(asked), UpdateAction::kRebuild);
  }
}

TEST(Governor, TimesInReasonsAreThoseThatAPersonWouldSay) {
  const std::pair<double, const char*> said[] = {
      {0, "under 0.01 ms"}, {4.9e3, "under 0.01 ms"}, {5e3, "0.01 ms"},   {0.283e6, "0.28 ms"}, {0.996e6, "1.0 ms"},
      {1.26e6, "1.3 ms"},   {9.96e6, "10 ms"},        {12.4e6, "12 ms"},  {99.4e6, "99 ms"},    {99.6e6, "0.10 s"},
      {0.28e9, "0.28 s"},   {3.14e9, "3.1 s"},        {121.07e9, "121 s"}};
  for (const auto& [nanoseconds, words] : said) EXPECT_EQ(as_time(nanoseconds), words) << nanoseconds;
}

TEST(Governor, WhatRaysLoseIsWeighedInWords) {
  UpdateQuestion asked = question(1000, 1);
  EXPECT_EQ(decide_update(asked, machine()).reason,
            "positions changed; rays lose too little in the refitted tree to repay a new one (39 ms)");
  asked = question(1e5, 2);
  EXPECT_EQ(decide_update(asked, machine()).reason.find("positions changed; rays lose 26 ms in the refitted tree, "),
            0u)
      << decide_update(asked, machine()).reason;
}

TEST(Governor, TheLedgerHoldsWhatWasWeighed) {
  const UpdateDecision decision = decide_update(question(1000, 2), machine());
  ASSERT_EQ(decision.alternatives.size(), 4u);
  EXPECT_EQ(decision.alternatives[0].action, UpdateAction::kRefit);
  EXPECT_DOUBLE_EQ(decision.alternatives[0].update_nanoseconds, 65536 * 10);
  EXPECT_DOUBLE_EQ(*decision.alternatives[0].trace_nanoseconds, 1000 * 2 * 260);
  EXPECT_DOUBLE_EQ(decision.alternatives[1].update_nanoseconds, 65536 * 25);
  EXPECT_DOUBLE_EQ(decision.alternatives[2].update_nanoseconds, 65536 * 80);
  EXPECT_EQ(decision.alternatives[3].action, UpdateAction::kRebuild);
  EXPECT_DOUBLE_EQ(decision.alternatives[3].update_nanoseconds, 65536 * 600);
  EXPECT_DOUBLE_EQ(*decision.alternatives[3].trace_nanoseconds, 1000 * 260);
  EXPECT_FALSE(decision.reason.empty());
}

}  // namespace
}  // namespace perfect_bvh::test
