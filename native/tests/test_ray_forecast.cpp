// Commits build better trees for the expected and the cast rays: each once, and no others.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "blas/make_blas.h"
#include "core/errors.h"
#include "query/trace.h"
#include "scene/scene.h"
#include "tests/calibrations.h"
#include "tests/mesh_sets.h"
#include "tests/scenes_to_trace.h"

namespace perfect_bvh::test {
namespace {

constexpr double kEndless = std::numeric_limits<double>::infinity();

TEST(RepayingRays, AreThoseFromWhichOnAnotherTreeIsLessWork) {
  static constexpr BuilderKind kBuilders[] = {BuilderKind::kFast, BuilderKind::kBinned, BuilderKind::kSpatial};
  for (const BuilderKind held : {BuilderKind::kFast, BuilderKind::kBinned}) {
    for (const double air : {1.0, 9.0, 16.0}) {
      BuildQuestion question{kBuilders, 5000, 0, air, held};
      const double repaying = repaying_rays(question, machine());
      EXPECT_EQ(repaying == kEndless, held == BuilderKind::kBinned && air < 5.0) << air;
      question.rays = std::min(0.999 * repaying, 1e12);
      EXPECT_EQ(decide_build(question, machine()).builder, held);
      if (repaying == kEndless) continue;
      question.rays = 1.001 * repaying;
      EXPECT_NE(decide_build(question, machine()).builder, held);
    }
  }
  EXPECT_EQ(repaying_rays({kBuilders, 5000, 0, 16.0, BuilderKind::kSpatial}, machine()), kEndless);
  EXPECT_EQ(repaying_rays({kBuilders, 5000, 0, 16.0, std::nullopt}, machine()), kEndless);
}

// A mesh whose rays are faster with spatial splits.
class Forecast : public testing::Test {
 protected:
  static constexpr std::size_t kTriangles = 600;

  std::int32_t add(const Mesh& data, Usage usage = Usage::kStatic, const BuildConfig& config = {}) {
    const std::int32_t mesh_id = scene_.add_mesh(Mesh(data), config, usage);
    const InstanceInput instance{mesh_id, {}, ~0u, std::nullopt};
    static_cast<void>(scene_.add_instances({&instance, 1}));
    return mesh_id;
  }

  CommitReport commit(std::optional<double> rays = std::nullopt, Policy policy = Policy::kGoverned) {
    CancelToken cancel;
    return scene_.commit(pool_, cancel, on_machine(rays, policy));
  }

  // Towards the middle from all around.
  void cast(std::size_t count) {
    const std::vector<Ray> some = random_rays(1000, 7, 3.0);
    const auto snapshot = scene_.snapshot();
    std::vector<Hit> hits(some.size());
    for (std::size_t done = 0; done < count; done += some.size()) {
      const std::size_t part = std::min(some.size(), count - done);
      static_cast<void>(trace_closest(*snapshot, std::span(some).first(part), std::span(hits).first(part)));
    }
  }

  std::string builder(std::int32_t mesh_id = 0) {
    return builder_name(scene_.snapshot()->meshes.at(static_cast<std::size_t>(mesh_id)).second->config.builder);
  }

  const Mesh crossed_ = slivers(kTriangles, 1).mesh();
  // From the calibration: this number of rays repays spatial splits where they gain most.
  const double repaying_ = 2.5 * kTriangles * 3000.0 / (200.0 - 180.0);
  Scene scene_;
  ThreadPool pool_{2};
};

TEST_F(Forecast, AMeshAtRestGetsABetterTreeOnce) {
  add(crossed_);
  EXPECT_EQ(commit().meshes[0].builder, std::string("binned"));
  const auto before = scene_.snapshot();
  const CommitReport better = commit(repaying_);
  ASSERT_EQ(better.meshes.size(), 1u);
  const MeshReport& row = better.meshes[0];
  EXPECT_EQ(row.action, MeshAction::kRebuilt);
  EXPECT_EQ(row.builder, std::string("spatial"));
  EXPECT_DOUBLE_EQ(row.expected_rays.value(), repaying_);
  EXPECT_NE(row.reason.find("the triangles rest"), std::string::npos) << row.reason;
  ASSERT_EQ(row.alternatives.size(), 2u);
  EXPECT_EQ(row.alternatives[0].action, MeshAction::kKept);
  EXPECT_EQ(row.alternatives[0].update_milliseconds, 0);
  EXPECT_LT(*row.alternatives[1].trace_milliseconds, *row.alternatives[0].trace_milliseconds);
  EXPECT_EQ(better.generation, before->generation + 1);
  EXPECT_EQ(better.kept_count, 0u);
  for (const std::optional<double> rays : {std::optional<double>(), {1e15}, {0.0}, {repaying_}}) {
    const CommitReport again = commit(rays);
    EXPECT_TRUE(again.meshes.empty() && again.resting.empty());
    EXPECT_EQ(again.generation, better.generation);
  }
  EXPECT_EQ(builder(), "spatial");
}

TEST_F(Forecast, FewRaysBuyNothingUntilTheyAreMany) {
  add(crossed_);
  static_cast<void>(commit(1.0));
  EXPECT_EQ(builder(), "fast");
  // Rays that the tree has already served count as well as expected ones.
  const double served = std::ceil(kTriangles * 600.0 / (220.0 - 200.0));
  for (int commits = 0; commits < 3; ++commits) EXPECT_TRUE(commit(1.0).meshes.empty());
  cast(static_cast<std::size_t>(served) / 2);
  EXPECT_TRUE(commit(1.0).meshes.empty());
  cast(static_cast<std::size_t>(served) / 2 + 1);
  EXPECT_EQ(commit(1.0).meshes.size(), 1u);
  EXPECT_EQ(builder(), "binned");
  EXPECT_TRUE(commit(1.0).meshes.empty()) << "the new tree has served no ray yet";
}

TEST_F(Forecast, WhatWasCastCountsWhereNothingWasTold) {
  add(crossed_);
  static_cast<void>(commit());
  EXPECT_TRUE(commit().meshes.empty()) << "nothing was cast";
  cast(1000);
  EXPECT_TRUE(commit().meshes.empty()) << "too few";
  cast(static_cast<std::size_t>(repaying_ / 4));
  const CommitReport report = commit();
  ASSERT_EQ(report.meshes.size(), 1u);
  EXPECT_EQ(report.meshes[0].builder, std::string("spatial"));
  EXPECT_EQ(report.meshes[0].expected_rays, std::nullopt);
  EXPECT_EQ(scene_.rays_cast(), 1000 + static_cast<std::size_t>(repaying_ / 4));
}

TEST_F(Forecast, FewRaysThatWereCastNeverLeadToAWorseTree) {
  add(crossed_);
  static_cast<void>(commit());
  cast(1);
  add(bumpy_sheet(20));
  EXPECT_EQ(commit().meshes.at(0).builder, std::string("binned"));
}

TEST_F(Forecast, AChangingMeshIsBuiltFastUntilRaysRepayMore) {
  add(crossed_, Usage::kChanging);
  EXPECT_EQ(commit().meshes[0].builder, std::string("fast"));
  scene_.replace_mesh(0, Mesh(crossed_));
  EXPECT_EQ(commit().meshes[0].builder, std::string("fast"));
  cast(static_cast<std::size_t>(kTriangles * 600.0 / (220.0 - 200.0)));
  scene_.replace_mesh(0, Mesh(crossed_));
  EXPECT_EQ(commit().meshes[0].builder, std::string("binned"));
  EXPECT_TRUE(commit(1e15).meshes.empty()) << "spatial splits take too long for a mesh that changes";
  scene_.set_usage(0, Usage::kStatic);
  EXPECT_EQ(commit(1e15).meshes.at(0).builder, std::string("spatial"));
}

TEST_F(Forecast, TheLastNumberIsRememberedUnlessItWasNone) {
  const std::int32_t mesh_id = add(crossed_);
  const auto expected = [&](std::optional<double> told) -> std::optional<double> {
    scene_.replace_mesh(mesh_id, Mesh(crossed_));
    const std::optional<double> rays = commit(told).meshes.at(0).expected_rays;
    return rays ? std::optional(std::round(*rays)) : std::nullopt;
  };
  EXPECT_EQ(expected(std::nullopt), std::nullopt);
  EXPECT_EQ(expected(0.0), 0.0);
  EXPECT_EQ(expected(std::nullopt), std::nullopt);
  EXPECT_EQ(expected(700.0), 700.0);
  EXPECT_EQ(expected(std::nullopt), 700.0);
  EXPECT_EQ(expected(0.0), 0.0);
  EXPECT_EQ(expected(std::nullopt), 700.0);
  cast(900);
  EXPECT_EQ(expected(std::nullopt), 900.0) << "more were cast than were expected";
  EXPECT_EQ(expected(std::nullopt), 700.0) << "nothing was cast since";
  cast(900);
  EXPECT_EQ(expected(30.0), 30.0) << "who tells knows better";
}

TEST_F(Forecast, NothingElseIsReplaced) {
  add(bumpy_sheet(24));                                              // spatial splits gain nothing there
  add(crossed_, Usage::kStatic, {.builder = BuilderKind::kBinned});  // requested
  add(crossed_, Usage::kDeforming);                                  // a better tree could not be refitted
  const std::int32_t deformed = add(crossed_);
  static_cast<void>(commit());
  Mesh moved = crossed_;
  for (Vec3f& position : moved.positions) position = position * 1.001f;
  scene_.update_mesh<float>(deformed, moved.positions);
  static_cast<void>(commit());
  for (const Policy policy : {Policy::kGoverned, Policy::kRefit, Policy::kRebuild}) {
    const CommitReport report = commit(1e15, policy);
    EXPECT_TRUE(report.meshes.empty()) << report.meshes[0].mesh_id;
  }
  scene_.replace_mesh(deformed, Mesh(crossed_));
  EXPECT_EQ(commit(1e15).meshes.at(0).builder, std::string("spatial")) << "other triangles, which never moved";
}

TEST_F(Forecast, AFixedPolicyReplacesNoTree) {
  add(crossed_);
  static_cast<void>(commit());
  EXPECT_TRUE(commit(1e15, Policy::kRefit).meshes.empty());
  EXPECT_EQ(commit(1e15).meshes.size(), 1u);
}

// Shares are kept only while nothing is edited.
TEST_F(Forecast, AMeshExpectsItsShareOfTheRays) {
  add(crossed_);
  const std::int32_t far = add(scaled(bumpy_sheet(4), 0.001f));
  Affine place;
  place.translation = {1000, 1000, 1000};
  const std::int32_t moved = 1;
  scene_.set_transforms(std::span(&moved, 1), std::span<const Affine>(&place, 1));
  static_cast<void>(commit());
  EXPECT_TRUE(commit(repaying_).meshes.empty()) << "most rays miss it";
  EXPECT_TRUE(commit(repaying_).meshes.empty());
  place.translation = {0, 0, 0};
  scene_.set_transforms(std::span(&moved, 1), std::span<const Affine>(&place, 1));
  EXPECT_EQ(commit(repaying_).meshes.size(), 1u);
  EXPECT_EQ(builder(far), "binned");
}

TEST_F(Forecast, ABetterTreeThatWasStoppedIsBuiltByTheNextCommit) {
  add(crossed_);
  static_cast<void>(commit());
  const auto before = scene_.snapshot();
  CancelToken stopped;
  stopped.request_stop();
  EXPECT_THROW(static_cast<void>(scene_.commit(pool_, stopped, on_machine(1e12))), Cancelled);
  EXPECT_EQ(scene_.snapshot(), before);
  EXPECT_EQ(commit().meshes.at(0).builder, std::string("spatial")) << "what was told counts";
}

// At any poll: nothing was edited, so the committed snapshot stays available all the time.
TEST_F(Forecast, ACommitOfABetterTreeThatIsStoppedLeavesTheSnapshot) {
  add(crossed_);
  static_cast<void>(commit());
  const std::uint64_t generation = scene_.snapshot()->generation;
  CommitOptions options;
  options.expected_rays = 1e12;
  options.calibration = machine();
  ThreadPool alone(1);
  int stops = 0;
  for (bool is_done = false; !is_done;) {
    int questions = 0;
    CancelToken cancel([&](float) { return questions++ < stops; }, std::chrono::milliseconds(0));
    try {
      static_cast<void>(scene_.commit(alone, cancel, options));
      is_done = true;
    } catch (const Cancelled&) {
      ++stops;
      ASSERT_TRUE(scene_.is_current()) << stops;
      ASSERT_EQ(scene_.snapshot()->generation, generation) << stops;
    }
  }
  EXPECT_GT(stops, 3);
  EXPECT_EQ(builder(), "spatial");
}

TEST_F(Forecast, HitsAreTheSameInTheBetterTree) {
  add(crossed_);
  static_cast<void>(commit());
  const std::vector<Ray> rays = random_rays(3000, 3, 2.0);
  std::vector<Hit> before(rays.size()), after(rays.size());
  static_cast<void>(trace_closest(*scene_.snapshot(), rays, before));
  static_cast<void>(commit(1e12));
  ASSERT_EQ(builder(), "spatial");
  static_cast<void>(trace_closest(*scene_.snapshot(), rays, after));
  for (std::size_t i = 0; i < rays.size(); ++i) {
    ASSERT_EQ(before[i].t, after[i].t);
    ASSERT_EQ(before[i].primitive_index, after[i].primitive_index);
  }
}

}  // namespace
}  // namespace perfect_bvh::test
