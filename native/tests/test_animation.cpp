// One tree for all frames of an animation: the decision, and what becomes of the tree from commit to commit.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "scene/scene.h"
#include "tests/calibrations.h"
#include "tests/failing_memory.h"
#include "tests/mesh_sets.h"
#include "tests/motions.h"
#include "tests/same_bytes.h"
#include "tests/swarms.h"
#include "tests/thread_counts.h"
#include "tests/tree_faults.h"
#include "tests/wide_trees.h"
#include "update/animation.h"

namespace perfect_bvh::test {
namespace {

// The decision --------------------------------------------------------------------------------------------------------

// Soon after it was built a tree loses what it will.
AnimationQuestion question(double rays, double loss, std::uint32_t frames = 301) {
  AnimationQuestion asked;
  asked.triangle_count = 65536;
  asked.shape_count = 16;
  asked.frame_count = frames;
  asked.rays = rays;
  asked.ray_nanoseconds = 200;
  asked.fresh = std::vector<double>(16, 200.0);
  asked.refitted = std::vector<double>(16, 200.0 + loss);
  asked.refitted[0] = 200;
  return asked;
}

bool builds(const AnimationQuestion& asked) { return decide_animation(asked, machine()).builds; }

TEST(AnimationDecision, NeedsRaysFramesAndLosses) {
  EXPECT_TRUE(builds(question(4e4, 100)));
  EXPECT_FALSE(builds(question(4e4, 0)));       // nothing is lost
  EXPECT_FALSE(builds(question(1e2, 100)));     // by hardly any ray
  EXPECT_FALSE(builds(question(4e4, 100, 9)));  // for so few frames
  EXPECT_FALSE(builds(question(4e4, 1e5)));     // trees of few frames are better, and rays repay each
}

// Rays that are worth a new tree in each frame are the most that it pays for.
TEST(AnimationDecision, PaysFromSomeRaysOnToSomeOthers) {
  int changes = 0;
  bool last = false;
  for (double rays = 1; rays < 1e12; rays *= 1.2) {
    const bool now = builds(question(rays, 100));
    changes += now != last;
    last = now;
  }
  EXPECT_EQ(changes, 2);
  EXPECT_FALSE(last);
}

TEST(AnimationDecision, SaysWhatItExpected) {
  const Calibration calibration = machine();
  const double binned = build_nanoseconds(65536, BuilderKind::kBinned, calibration), refit = 65536 * 10.0;
  for (const double rays : {1e2, 4e4}) {
    const AnimationDecision decision = decide_animation(question(rays, 100), calibration);
    EXPECT_EQ(decision.alternative.action, UpdateAction::kAnimate);
    EXPECT_NEAR(decision.alternative.update_nanoseconds, (11 * binned + 32 * refit) / 301 + refit, 1);
    const double loss = 100 * (1 - 1 / 30.0);  // in the mean, of which 0.4 stays
    EXPECT_NEAR(*decision.alternative.trace_nanoseconds, rays * (200 + 0.4 * loss), rays * 0.1);
    EXPECT_EQ(decision.builds, rays > 1e3);
    EXPECT_NE(decision.words.find(decision.builds ? "one tree for the 301 frames to come is built for"
                                                  : "one tree for the 301 frames to come would take"),
              std::string::npos)
        << decision.words;
  }
}

TEST(AnimationDecision, LooksAtShapesOnlyWhereThatCanMatter) {
  EXPECT_TRUE(may_animate(question(4e4, 100), machine()));
  for (const auto& [rays, frames] : {std::pair{1e1, 100u}, std::pair{1e6, 5u}}) {
    AnimationQuestion asked = question(rays, 1e9, frames);
    EXPECT_FALSE(may_animate(asked, machine()));
    EXPECT_FALSE(builds(asked)) << "what is not looked at must not have paid";
    asked.refitted.clear(), asked.fresh.clear();
    const AnimationDecision decision = decide_animation(asked, machine());
    EXPECT_FALSE(decision.builds);
    EXPECT_NE(decision.words.find("more than it could save"), std::string::npos);
    EXPECT_EQ(*decision.alternative.trace_nanoseconds, rays * 200);
  }
}

TEST(AnimationDecision, WhatWasForeseenIsKeptAndNoMore) {
  UpdateQuestion asked;
  asked.triangle_count = 65536;
  asked.rays = 1e9;  // which would rebuild for any loss
  asked.reference = asked.history.fresh = {10, 4};
  asked.history.foreseen = {300, 2};
  asked.now = {11, 5};
  EXPECT_FALSE(may_rebuild(asked, machine()));
  EXPECT_FALSE(may_restructure(asked, machine()));
  UpdateDecision decision = decide_update(asked, machine());
  EXPECT_EQ(decision.action, UpdateAction::kRefit);
  EXPECT_EQ(decision.history.foreseen.commit_count, 1u);
  EXPECT_EQ(decision.history.since_build.commit_count, 0u);
  EXPECT_EQ(decision.alternatives.size(), 4u);

  UpdateQuestion worse = asked;
  worse.now = {13, 5};
  EXPECT_TRUE(may_rebuild(worse, machine()));
  EXPECT_EQ(decide_update(worse, machine()).action, UpdateAction::kRebuild);
  EXPECT_EQ(decide_update(worse, machine()).history.foreseen.commit_count, 0u);

  asked.history.foreseen.commit_count = 0;  // its frames are over
  EXPECT_EQ(decide_update(asked, machine()).action, UpdateAction::kRebuild);
  asked.history.foreseen.commit_count = 2;
  asked.policy = Policy::kRotate;
  EXPECT_EQ(decide_update(asked, machine()).action, UpdateAction::kRotate);
}

// The scene -----------------------------------------------------------------------------------------------------------

constexpr std::uint32_t kShapes = 33, kFrames = 200;
constexpr double kRays = 120;  // which lose a good part of what a new tree costs

AlignedVector<Vec3f> positions_of(const Shapes& shapes) {
  AlignedVector<Vec3f> all;
  for (std::size_t i = 0; i < shapes.sample_count(); ++i) {
    all.insert(all.end(), shapes[i].positions.begin(), shapes[i].positions.end());
  }
  return all;
}

struct Animated {
  Animated() : shapes(swarms(kShapes)) {
    static_cast<void>(scene.add_mesh(Mesh(shapes[0]), {}, Usage::kDeforming));
    scene.add_instances(std::vector<InstanceInput>{{0, Affine{}, 1u, {}}});
  }
  void expect(std::uint32_t frames = kFrames) {
    const AlignedVector<Vec3f> all = positions_of(shapes);
    scene.expect_animation<float>(0, all, kShapes, frames);
  }
  void move_to(std::size_t shape) { scene.update_mesh<float>(0, shapes[shape].positions); }
  MeshReport commit(std::optional<double> rays = kRays, Policy policy = Policy::kGoverned) {
    CancelToken cancel;
    return commit(cancel, rays, policy);
  }
  MeshReport commit(CancelToken& cancel, std::optional<double> rays = kRays, Policy policy = Policy::kGoverned) {
    return scene.commit(pool, cancel, on_machine(rays, policy)).meshes.at(0);
  }
  [[nodiscard]] const WideBvh& tree() const { return scene.snapshot()->blases[0]->wide; }

  Shapes shapes;
  Scene scene;
  ThreadPool pool{1};
};

bool weighs(const MeshReport& report) {
  return std::ranges::any_of(report.alternatives,
                             [](const AlternativeReport& row) { return row.action == MeshAction::kAnimated; });
}

TEST(AnimatedScene, BuildsOneTreeAndKeepsIt) {
  Animated one;
  one.expect();
  const MeshReport first = one.commit();
  EXPECT_EQ(first.action, MeshAction::kAnimated) << first.reason;
  EXPECT_TRUE(weighs(first));
  EXPECT_GT(first.optimize_milliseconds, 0);
  for (const std::size_t shape : {1u, 2u, 3u, 30u, 0u, 16u, 1u}) {  // in order, and any jumps
    one.move_to(shape);
    const MeshReport report = one.commit();
    EXPECT_EQ(report.action, MeshAction::kRefitted) << report.reason;
    EXPECT_FALSE(weighs(report));
    EXPECT_EQ(find_wide_fault(one.tree(), one.shapes[shape], true), "") << shape;
    expect_tight(one.tree(), one.shapes[shape], "refitted");
  }
}

TEST(AnimatedScene, WeighsItInAnUpdateToo) {
  Animated one;
  static_cast<void>(one.commit());
  one.expect();
  EXPECT_TRUE(one.scene.is_current());
  one.move_to(1);
  EXPECT_EQ(one.commit().action, MeshAction::kAnimated);
  EXPECT_EQ(find_wide_fault(one.tree(), one.shapes[1], true), "");
}

TEST(AnimatedScene, SaysThatItDoesNotPay) {
  Animated one;
  one.expect(2);
  const MeshReport report = one.commit();
  EXPECT_EQ(report.action, MeshAction::kBuilt);
  EXPECT_TRUE(weighs(report));
  EXPECT_NE(report.reason.find("one tree for the 2 frames to come would take"), std::string::npos) << report.reason;
  one.move_to(1);
  EXPECT_FALSE(weighs(one.commit())) << "it was weighed";
}

TEST(AnimatedScene, WaitsForRaysAndForThePolicy) {
  Animated one;
  one.expect(4);
  EXPECT_FALSE(weighs(one.commit(std::nullopt)));
  one.move_to(1);
  EXPECT_FALSE(weighs(one.commit(kRays, Policy::kRefit)));
  one.move_to(2);
  EXPECT_TRUE(weighs(one.commit()));
  Animated other;
  other.expect(2);
  static_cast<void>(other.commit(std::nullopt));
  other.move_to(1);
  static_cast<void>(other.commit(std::nullopt));
  other.move_to(2);
  EXPECT_FALSE(weighs(other.commit())) << "its frames are over";
}

TEST(AnimatedScene, ForgetsWithTheTopology) {
  Animated one;
  one.expect();
  one.scene.replace_mesh(0, Mesh(one.shapes[0]));
  EXPECT_FALSE(weighs(one.commit()));
  one.expect();
  one.move_to(1);
  EXPECT_EQ(one.commit().action, MeshAction::kAnimated);
  one.scene.replace_mesh(0, bumpy_sheet(10));
  EXPECT_EQ(one.commit().action, MeshAction::kRebuilt);
}

TEST(AnimatedScene, ThePolicyBuildsItAlways) {
  Animated one;
  one.expect(2);
  const MeshReport first = one.commit(std::nullopt, Policy::kAnimate);
  EXPECT_EQ(first.action, MeshAction::kAnimated) << first.reason;
  EXPECT_FALSE(weighs(first));
  one.move_to(3);
  EXPECT_EQ(one.commit(std::nullopt, Policy::kAnimate).action, MeshAction::kRefitted);
}

// Shapes that nobody told, worse than all that were.
TEST(AnimatedScene, RebuildsWhatDecaysMoreThanForeseen) {
  Animated one;
  one.expect();
  ASSERT_EQ(one.commit().action, MeshAction::kAnimated);
  const Mesh burst = moved(one.shapes[0], {"", [](Positions& p) { scatter(p, 3.0f, 4); }});
  one.scene.update_mesh<float>(0, burst.positions);
  EXPECT_EQ(one.commit(1e9).action, MeshAction::kRebuilt);
  EXPECT_EQ(find_wide_fault(one.tree(), burst, true), "");
}

TEST(AnimatedScene, IsTheSameForAnyNumberOfThreads) {
  Animated one;
  one.expect();
  ASSERT_EQ(one.commit().action, MeshAction::kAnimated);
  for (const int count : thread_counts()) {
    Animated other;
    other.expect();
    ThreadPool pool(count);
    CancelToken cancel;
    const CommitReport report = other.scene.commit(pool, cancel, on_machine(kRays));
    EXPECT_EQ(report.meshes[0].action, MeshAction::kAnimated);
    EXPECT_TRUE(same_bytes(other.tree(), one.tree())) << count;
  }
}

// At many places where a commit asks whether to stop: nothing is left behind, and the next one does it all.
TEST(AnimatedScene, CanBeStoppedAnywhere) {
  Animated undisturbed;
  undisturbed.expect();
  ASSERT_EQ(undisturbed.commit().action, MeshAction::kAnimated);
  int stops = 0;
  for (long after = 0;; after += 1 + after / 6) {
    Animated one;
    one.expect();
    CancelToken cancel;
    StopComes stop(after, cancel);
    bool is_done = true;
    try {
      static_cast<void>(one.commit(cancel));
    } catch (const Cancelled&) {
      is_done = false;
    }
    if (!stop.end()) break;
    if (is_done) continue;
    ++stops;
    ASSERT_EQ(one.commit().action, MeshAction::kAnimated) << after;
    ASSERT_TRUE(same_bytes(one.tree(), undisturbed.tree())) << after;
  }
  EXPECT_GT(stops, 15);
}

TEST(AnimatedScene, RefusesByName) {
  Animated one;
  static_cast<void>(one.scene.add_mesh(bumpy_sheet(4), {.builder = BuilderKind::kSpatial}, Usage::kStatic));
  static_cast<void>(one.scene.add_mesh(bumpy_sheet(4), {.builder = BuilderKind::kSweep}, Usage::kStatic));
  AlignedVector<Vec3f> all = positions_of(one.shapes);
  const auto why = [&](std::int32_t mesh, std::span<const Vec3f> positions) -> std::string {
    try {
      one.scene.expect_animation<float>(mesh, positions, kShapes, 10);
    } catch (const InvalidArgument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(why(7, all).find("expect_animation: there is no mesh with id 7"), std::string::npos);
  EXPECT_NE(why(1, all).find("spatial splits"), std::string::npos);
  EXPECT_NE(why(2, all).find("'sweep', which stays"), std::string::npos);
  EXPECT_NE(why(0, std::span(all).first(10)).find("expect_animation: positions has"), std::string::npos);
  all[7].y = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(why(0, all).find("expect_animation: positions"), std::string::npos);
  EXPECT_FALSE(weighs(one.commit())) << "nothing was told";
}

}  // namespace
}  // namespace perfect_bvh::test
