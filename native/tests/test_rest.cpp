// Meshes that were deformed and then rest, with trees that their motion degraded.
#include <gtest/gtest.h>

#include "scene/scene.h"
#include "tests/calibrations.h"
#include "tests/mesh_sets.h"
#include "tests/same_bytes.h"
#include "tests/tree_faults.h"
#include "tests/wide_trees.h"
#include "update/governor.h"

namespace perfect_bvh::test {
namespace {

// A ray loses 100 ns in this tree.
RestQuestion question(std::optional<double> rays) {
  RestQuestion asked;
  asked.triangle_count = 65536;
  asked.rays = rays;
  asked.history.fresh = {10, 4}, asked.history.now = {15, 4};
  asked.history.since_build.commit_count = 1;
  return asked;
}

TEST(Rest, OnlyWhatMotionLoosenedIsDegraded) {
  EXPECT_TRUE(is_degraded(question(1).history, machine()));
  UpdateHistory history = question(1).history;
  history.since_build.commit_count = 0;  // nothing has happened since the build
  EXPECT_FALSE(is_degraded(history, machine()));
  history = question(1).history;
  history.now = history.fresh;
  EXPECT_FALSE(is_degraded(history, machine()));
  history.sample = 1, history.sample_now = 0.5;  // a fresh tree would be better than the last one was
  EXPECT_TRUE(is_degraded(history, machine()));
  EXPECT_FALSE(is_degraded({}, machine()));
}

TEST(Rest, ATreeIsBuiltAsSoonAsWhatRaysLostWouldHavePaidForIt) {
  const double build = build_nanoseconds(65536, BuilderKind::kBinned, machine());
  for (const double commits : {0.5, 3.5, 40.5}) {
    RestQuestion asked = question(build / 100 / commits);
    int count = 0;
    UpdateDecision decision;
    do {
      decision = decide_at_rest(asked, machine());
      EXPECT_FALSE(decision.reason.empty());
      asked.history = decision.history;
      ++count;
    } while (decision.action == UpdateAction::kKeep && count < 1000);
    EXPECT_EQ(decision.action, UpdateAction::kRebuild);
    EXPECT_EQ(count, static_cast<int>(commits + 0.5));
  }
}

TEST(Rest, WithoutExpectedRaysTheTreeIsKept) {
  for (const std::optional<double> rays : {std::optional<double>(), std::optional<double>(0.0)}) {
    RestQuestion asked = question(rays);
    for (int commit = 0; commit < 1000; ++commit) {
      const UpdateDecision decision = decide_at_rest(asked, machine());
      ASSERT_EQ(decision.action, UpdateAction::kKeep);
      ASSERT_EQ(decision.alternatives[0].trace_nanoseconds.has_value(), rays.has_value());
      asked.history = decision.history;
    }
  }
}

// A mesh twisted by 2 pi, and another one that goes on being edited.
class RestingMesh : public testing::Test {
 protected:
  RestingMesh() {
    still_ = bumpy_sheet(60);
    twisted_ = moved(still_, {"", [](Positions& p) { twist(p, 6.2831853f); }});
    for (const Mesh& mesh : {still_, other_}) {
      const std::int32_t mesh_id = scene_.add_mesh(Mesh(mesh), {}, Usage::kDeforming);
      const InstanceInput instance{mesh_id, {}, ~0u, std::nullopt};
      static_cast<void>(scene_.add_instances({&instance, 1}));
    }
  }

  // Twists the mesh without expected rays: it is refitted.
  void twist_unseen() {
    static_cast<void>(commit(0.0));
    scene_.update_mesh<float>(0, twisted_.positions);
    ASSERT_EQ(commit(0.0).meshes[0].action, MeshAction::kRefitted);
  }

  CommitReport commit(std::optional<double> rays, Policy policy = Policy::kGoverned) {
    CancelToken cancel;
    return scene_.commit(pool_, cancel, on_machine(rays, policy));
  }

  // Commits after the other mesh has moved.
  CommitReport commit_beside(std::optional<double> rays, Policy policy = Policy::kGoverned) {
    for (Vec3f& position : other_.positions) position = position * 1.01f;
    scene_.update_mesh<float>(1, other_.positions);
    return commit(rays, policy);
  }

  Mesh still_, twisted_, other_ = triangle_soup(50, 0.1f);
  Scene scene_;
  ThreadPool pool_{2};
};

TEST_F(RestingMesh, IsBuiltAnewOnceWhenTheRaysRepayIt) {
  twist_unseen();
  const WideBvh degraded = scene_.snapshot()->meshes.at(0).second->wide;
  int kept = 0, rebuilt = 0;
  for (int frame = 0; frame < 60; ++frame) {
    const CommitReport report = commit_beside(20000.0);
    ASSERT_EQ(report.meshes.back().mesh_id, 1);
    if (report.meshes[0].mesh_id == 0) {
      ++rebuilt;
      EXPECT_EQ(report.meshes[0].action, MeshAction::kRebuilt);
      EXPECT_NE(report.meshes[0].reason.find("enough to rebuild"), std::string::npos) << report.meshes[0].reason;
      EXPECT_EQ(report.kept_count, 0u);
      EXPECT_TRUE(report.resting.empty());
    } else if (rebuilt == 0) {
      ++kept;
      ASSERT_EQ(report.resting.size(), 1u);
      const MeshReport& row = report.resting[0];
      EXPECT_EQ(row.mesh_id, 0);
      EXPECT_EQ(row.action, MeshAction::kKept);
      EXPECT_NE(row.reason.find("too little to rebuild"), std::string::npos) << row.reason;
      ASSERT_EQ(row.alternatives.size(), 2u);
      EXPECT_EQ(row.alternatives[0].action, MeshAction::kKept);
      EXPECT_GT(*row.alternatives[0].trace_milliseconds, *row.alternatives[1].trace_milliseconds);
      EXPECT_EQ(report.kept_count, 1u);
      ASSERT_TRUE(same_bytes(scene_.snapshot()->meshes.at(0).second->wide, degraded));
    } else {
      EXPECT_TRUE(report.resting.empty());
    }
  }
  EXPECT_GT(kept, 1);
  EXPECT_EQ(rebuilt, 1);
  const WideBvh& tree = scene_.snapshot()->meshes.at(0).second->wide;
  EXPECT_EQ(find_wide_fault(tree, twisted_, true), "");
  EXPECT_TRUE(same_bytes(tree, build(twisted_, {"auto", {}})));
}

TEST_F(RestingMesh, StaysAsItIsWhereTheRaysAreUnknown) {
  twist_unseen();
  const WideBvh degraded = scene_.snapshot()->meshes.at(0).second->wide;
  for (int frame = 0; frame < 60; ++frame) {
    const CommitReport report = commit_beside(std::nullopt);
    ASSERT_EQ(report.resting.size(), 1u);
    EXPECT_NE(report.resting[0].reason.find("expected rays is unknown"), std::string::npos) << report.resting[0].reason;
  }
  EXPECT_TRUE(same_bytes(scene_.snapshot()->meshes.at(0).second->wide, degraded));
}

TEST_F(RestingMesh, IsLeftAloneByFixedPolicies) {
  twist_unseen();
  for (const Policy policy : {Policy::kRefit, Policy::kRebuild}) {
    const CommitReport report = commit_beside(1e12, policy);
    EXPECT_EQ(report.meshes.size(), 1u);
    EXPECT_TRUE(report.resting.empty());
  }
}

// The rays of a commit without edits count too; its snapshot is another one.
TEST_F(RestingMesh, IsBuiltAnewAlthoughNothingIsEdited) {
  twist_unseen();
  const auto before = scene_.snapshot();
  const CommitReport report = commit(1e9);
  ASSERT_EQ(report.meshes.size(), 1u);
  EXPECT_EQ(report.meshes[0].action, MeshAction::kRebuilt);
  EXPECT_EQ(report.generation, before->generation + 1);
  EXPECT_NE(scene_.snapshot(), before);
  EXPECT_EQ(commit(1e9).generation, report.generation);
}

// The loss at rest is forgotten once the mesh moves.
TEST_F(RestingMesh, StartsAnewAfterEachMove) {
  twist_unseen();
  for (int frame = 0; frame < 60; ++frame) {
    const CommitReport report = commit_beside(20000.0);
    ASSERT_EQ(report.meshes.size(), 1u);
    scene_.update_mesh<float>(0, twisted_.positions);
    ASSERT_EQ(commit(0.0).meshes[0].action, MeshAction::kRefitted);
  }
}

}  // namespace
}  // namespace perfect_bvh::test
