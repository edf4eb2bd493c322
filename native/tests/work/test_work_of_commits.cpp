// In a scene of any size, the work of a commit between two polls for cancellation is bounded: builders, refits,
// restructuring, collapse, instances. Counted, not timed (count_work.h).
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "scene/scene.h"
#include "tests/scenes_to_trace.h"
#include "tests/work/count_work.h"

namespace perfect_bvh::test {
namespace {

// Allowed runs of a block: for 16,384 items some ten levels deep, or for this many items outside of builds.
constexpr std::uint32_t kMostRuns = 1u << 18;
// A subtree of 16,384 references in three orders, and slices of as many by 64 planes.
constexpr std::uint32_t kMostRunsOfSlowBuilders = 1u << 20;
// Enough triangles to notice each loop: the wide tree has a sixth as many leaves, and a twentieth as many nodes, with 8
// children each.
constexpr std::size_t kMany = 1'200'000;
constexpr std::size_t kEnough = 300'000;  // for loops over triangles and over the binary tree

MeshData surface(std::size_t triangle_count) {
  return box_of_grids(static_cast<std::int32_t>(std::sqrt(static_cast<double>(triangle_count) / 12.0)));
}

MeshData one_again_and_again(std::size_t triangle_count) {
  MeshData data;
  data.positions = {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}};
  data.triangles.assign(triangle_count, {0, 1, 2});
  return data;
}

void twist(MeshData& data, float angle) {
  for (Vec3f& p : data.positions) {
    const float c = std::cos(angle * p.z), s = std::sin(angle * p.z);
    p = {c * p.x - s * p.y, s * p.x + c * p.y, p.z};
  }
}

class WorkBetweenQuestions : public testing::TestWithParam<int> {
 protected:
  [[nodiscard]] static std::size_t many() { return GetParam() == 1 ? kMany : kEnough; }

  std::int32_t add(const MeshData& data, const BuildConfig& config, Usage usage = Usage::kStatic) {
    const std::int32_t mesh = scene_->add_mesh(data.mesh(), config, usage);
    place(mesh);
    return mesh;
  }
  void place(std::int32_t mesh) {
    const InstanceInput input{mesh, Affine{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}, 1u, {}};
    scene_->add_instances({&input, 1});
  }

  CommitReport commit(const CommitOptions& options = {}, std::uint32_t most_runs = kMostRuns) {
    asked_ = 0;
    CancelToken cancel(
        [&](float) {
          ++asked_;
          count_from_here();
          return true;
        },
        std::chrono::milliseconds(0));
    begin_counting(most_runs);
    CommitReport report = scene_->commit(pool_, cancel, options);
    unasked_ = end_counting();
    return report;
  }
  void expect_bounded(const std::string& what) const {
    for (const std::string& each : unasked_) ADD_FAILURE() << what << ": " << each;
    EXPECT_GT(asked_, 5u) << what;
  }

  // Every method by which a tree follows its triangles.
  void move_and_commit(std::int32_t mesh, MeshData data) {
    const std::vector<std::pair<Policy, MeshAction>> ways{{Policy::kRefit, MeshAction::kRefitted},
                                                          {Policy::kRotate, MeshAction::kRotated},
                                                          {Policy::kRebuildParts, MeshAction::kPartlyRebuilt},
                                                          {Policy::kRebuild, MeshAction::kRebuilt}};
    for (const auto& [policy, action] : ways) {
      twist(data, 0.7f);
      scene_->update_mesh(mesh, std::span<const Vec3f>(data.positions), pool_);
      CommitOptions options;
      options.policy = policy;
      const CommitReport report = commit(options);
      ASSERT_EQ(report.meshes.size(), 1u);
      EXPECT_EQ(report.meshes[0].action, action) << report.meshes[0].reason;
      expect_bounded("policy " + std::to_string(static_cast<int>(policy)));
    }
    twist(data, 0.7f);
    scene_->update_mesh(mesh, std::span<const Vec3f>(data.positions), pool_);
    CommitOptions options;
    options.expected_rays = 1e6;
    static_cast<void>(commit(options));
    expect_bounded("governed");
  }

  ThreadPool pool_{GetParam()};
  std::optional<Scene> scene_{std::in_place};
  std::vector<std::string> unasked_;
  std::size_t asked_ = 0;
};

struct NamedConfig {
  std::string name;
  BuildConfig config;
  Usage usage = Usage::kStatic;
  std::uint32_t most_runs = kMostRuns;
};

std::vector<NamedConfig> builders() {
  std::vector<NamedConfig> all{{"auto", {}},
                               {"fast", {.builder = BuilderKind::kFast}},
                               {"binned", {.builder = BuilderKind::kBinned}},
                               {"median", {.builder = BuilderKind::kMedian}},
                               {"sweep", {.builder = BuilderKind::kSweep}},
                               {"spatial", {.builder = BuilderKind::kSpatial}},
                               {"optimize", {.builder = BuilderKind::kBinned}},
                               {"changing", {}, Usage::kChanging}};
  for (NamedConfig& each : all) {
    const bool is_slow = each.config.builder == BuilderKind::kSweep || each.config.builder == BuilderKind::kSpatial ||
                         each.config.builder == BuilderKind::kMedian;
    if (is_slow) each.most_runs = kMostRunsOfSlowBuilders;
    if (each.name == "optimize") each.config.optimize_passes = 2;
  }
  return all;
}

TEST_P(WorkBetweenQuestions, IsBoundedInEveryBuilder) {
  for (const NamedConfig& each : builders()) {
    scene_.emplace();
    add(surface(each.config.optimize_passes > 0 ? kEnough : many()), each.config, each.usage);
    static_cast<void>(commit({}, each.most_runs));
    expect_bounded(each.name);
  }
}

// If all triangles are equal, builders halve them.
TEST_P(WorkBetweenQuestions, IsBoundedWhereAllTrianglesAreTheSame) {
  for (const NamedConfig& each : builders()) {
    scene_.emplace();
    add(one_again_and_again(kEnough), each.config, each.usage);
    static_cast<void>(commit({}, each.most_runs));
    expect_bounded(each.name);
  }
}

TEST_P(WorkBetweenQuestions, IsBoundedWhereTrianglesMove) {
  const MeshData data = surface(many());
  const std::int32_t mesh = add(data, {});
  static_cast<void>(commit());
  move_and_commit(mesh, data);
}

TEST_P(WorkBetweenQuestions, IsBoundedForInstances) {
  constexpr std::size_t kCount = 600'000;
  const std::int32_t mesh = scene_->add_mesh(soup(20, 1).mesh(), {}, Usage::kStatic);
  Random random(3);
  std::vector<Affine> maps;
  std::vector<InstanceInput> inputs;
  for (std::size_t i = 0; i < kCount; ++i) {
    maps.push_back({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, to_double(random_point(random, 50.0f))});
    inputs.push_back({mesh, maps.back(), 1u, {}});
  }
  const std::int32_t first = scene_->add_instances(inputs);
  CommitOptions options;
  options.expected_rays = 1e6;
  // For 16,384 nodes, three axes of seven lanes each.
  constexpr std::uint32_t kMostRunsOfTopLevels = 2 * kMostRuns;
  EXPECT_FALSE(commit(options, kMostRunsOfTopLevels).top_level.is_refitted);
  expect_bounded("build");
  std::vector<std::int32_t> ids;
  for (std::size_t i = 0; i < kCount; ++i) {
    ids.push_back(first + static_cast<std::int32_t>(i));
    maps[i].translation.x += 0.001;
  }
  scene_->set_transforms(ids, maps);
  EXPECT_TRUE(commit(options, kMostRunsOfTopLevels).top_level.is_refitted);
  expect_bounded("refit");
}

TEST_P(WorkBetweenQuestions, IsBoundedForBakedMeshes) {
  const std::int32_t mesh = scene_->add_mesh(surface(kEnough).mesh(), {}, Usage::kStatic);
  const InstanceInput flat{mesh, Affine{{1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {0, 0, 0}}, 1u, {}};
  scene_->add_instances({&flat, 1});
  EXPECT_EQ(commit().baked_count, 1u);
  expect_bounded("baked");
}

// With more threads, the others wait in turn until the caller has polled: it must poll whether it works or waits.
INSTANTIATE_TEST_SUITE_P(Threads, WorkBetweenQuestions, testing::Values(1, 3));

}  // namespace
}  // namespace perfect_bvh::test
