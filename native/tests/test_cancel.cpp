// How much work lies between two questions whether to stop, where each ray is dear: counted, not timed.
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <vector>

#include "query/audit.h"
#include "query/closest_points.h"
#include "query/intersections.h"
#include "query/ray_batch.h"
#include "tests/scenes_to_trace.h"
#include "wide/run_cutter.h"

namespace perfect_bvh::test {
namespace {

using std::chrono::milliseconds;

// Triangles that are all the same one: a ray that meets one tests all of them.
constexpr std::size_t kTriangles = 1024, kRays = 2048, kInstances = 2;
constexpr std::size_t kLeafVisits = kRays * kInstances * kTriangles / kLeafSize;  // at least
// A step is at most a leaf for each ray in flight.
constexpr std::size_t kMostLeavesBetween = kStepsBetweenAsking * kMostRaysInFlight;

std::shared_ptr<const Snapshot> make_snapshot(TreeLayout layout, bool is_lazy) {
  MeshData data;
  data.positions = {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}};
  data.triangles.assign(kTriangles, {0, 1, 2});
  Scene scene;
  BuildConfig config;
  config.layout = layout;
  std::vector<InstanceInput> inputs;
  for (std::size_t i = 0; i < kInstances; ++i) {
    const std::int32_t mesh = scene.add_mesh(data.mesh(), config, Usage::kStatic, is_lazy);
    inputs.push_back({mesh, Affine{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}, 1u, {}});
  }
  scene.add_instances(inputs);
  ThreadPool pool(1);
  CancelToken never;
  scene.commit(pool, never);
  return scene.snapshot();
}

// Rays from above and points, one a row, and room for whatever is asked about them.
struct Query {
  Query() {
    Random random(1);
    for (std::size_t i = 0; i < kRays; ++i) {
      origins.push_back({uniform(random, -0.2f, 0.2f), uniform(random, -0.2f, 0.2f), 1.0});
    }
    rays.count = kRays;
    rays.origins_double = origins.data(), rays.directions_double = directions.data();
    rays.t_min = &t_min, rays.t_max = &t_max, rays.masks = &mask;
    points = {kRays, origins.data(), &farthest, &mask, 0, 0};
    closest = {vectors.data(), t.data(), ids.data(), ids.data(), ids.data(), uvs.data()};
  }
  std::vector<Vec3d> origins, directions{kRays, Vec3d{0.0, 0.0, -1.0}};
  float t_min = 0.0f, t_max = 1e30f;
  double farthest = 1e30;
  std::uint32_t mask = 1;
  RayColumns rays;
  PointColumns points;
  std::vector<std::int32_t> ids = std::vector<std::int32_t>(kRays);
  std::vector<double> vectors = std::vector<double>(3 * kRays), t = std::vector<double>(kRays);
  std::vector<float> uvs = std::vector<float>(2 * kRays);
  std::vector<std::uint8_t> flags = std::vector<std::uint8_t>(kRays);
  ClosestColumns closest;
};

class Cancelling : public KernelTest {
 protected:
  using Run = std::function<void(const Snapshot&, Query&, ThreadPool&, CancelToken&)>;

  static Run casting(Strategy strategy) {
    return [strategy](const Snapshot& snapshot, Query& query, ThreadPool& pool, CancelToken& cancel) {
      query.rays.strategy = strategy;
      HitColumns out;
      out.instance_ids = query.ids.data();
      cast_rays(snapshot, query.rays, out, pool, 0, cancel);
    };
  }
  static void count(const Snapshot& snapshot, Query& query, ThreadPool& pool, CancelToken& cancel) {
    count_intersections(snapshot, query.rays, query.ids.data(), pool, 0, cancel);
  }
  static void list(const Snapshot& snapshot, Query& query, ThreadPool& pool, CancelToken& cancel) {
    std::vector<std::int64_t> splits;
    for (std::size_t i = 0; i <= query.rays.count; ++i) splits.push_back(static_cast<std::int64_t>(i));
    HitColumns out;
    out.instance_ids = query.ids.data();
    list_intersections(snapshot, query.rays, splits, out, pool, 0, cancel);
  }
  static void find_closest(const Snapshot& snapshot, Query& query, ThreadPool& pool, CancelToken& cancel) {
    compute_closest_points(snapshot, query.points, query.closest, pool, 0, cancel);
  }
  static std::vector<Run> all_queries() {
    std::vector<Run> all{count, list, find_closest};
    for (const Strategy strategy : {Strategy::kAuto, Strategy::kPackets, Strategy::kStream, Strategy::kSingle}) {
      all.push_back(casting(strategy));
    }
    return all;
  }
};

INSTANTIATE_TEST_SUITE_P(All, Cancelling, testing::ValuesIn(kernel_cases()), Cancelling::name_of);

TEST_P(Cancelling, IsAskedEverySoManyLeafVisits) {
  const auto snapshot = make_snapshot(GetParam().layout, false);
  const std::vector<Run> all = all_queries();
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::size_t asked = 0;
    CancelToken cancel([&](float) { return ++asked != 0; }, milliseconds(0));
    ThreadPool pool(1);
    Query query;
    all[i](*snapshot, query, pool, cancel);
    EXPECT_GE(asked, kLeafVisits / kMostLeavesBetween) << "query " << i;
  }
}

TEST_P(Cancelling, StopsAtTheQuestionThatSaysSo) {
  for (const bool is_lazy : {false, true}) {
    for (const Run& run : all_queries()) {
      const auto snapshot = make_snapshot(GetParam().layout, is_lazy);
      std::size_t asked = 0;
      CancelToken cancel([&](float) { return ++asked < 5; }, milliseconds(0));
      ThreadPool pool(1);
      Query query;
      EXPECT_THROW(run(*snapshot, query, pool, cancel), Cancelled);
      EXPECT_EQ(asked, 5u);
    }
  }
}

// In the middle of a kernel, whose memory they must not share.
TEST_P(Cancelling, LetsTheCallbackCastRaysOfItsOwn) {
  for (const bool is_lazy : {false, true}) {
    for (const Run& run : all_queries()) {
      const auto snapshot = make_snapshot(GetParam().layout, is_lazy);
      Query expected, query;
      for (Query* each : {&expected, &query}) each->rays.count = each->points.count = kRays / 2;
      ThreadPool pool(1);
      CancelToken never;
      run(*make_snapshot(GetParam().layout, false), expected, pool, never);
      std::size_t asked = 0;
      const Run cast = casting(Strategy::kAuto);
      CancelToken cancel(
          [&](float) {
            if (++asked != 2) return true;  // the first is asked before the kernel runs
            Query other;
            other.rays.count = other.points.count = 70;
            cast(*snapshot, other, pool, never);
            find_closest(*snapshot, other, pool, never);
            return true;
          },
          milliseconds(0));
      run(*snapshot, query, pool, cancel);
      EXPECT_GE(asked, 2u);
      EXPECT_EQ(query.ids, expected.ids);
      EXPECT_EQ(query.t, expected.t);
    }
  }
}

TEST_P(Cancelling, TellsWhatTheCallbackThrew) {
  const auto snapshot = make_snapshot(TreeLayout::kDefault, false);
  std::size_t asked = 0;
  CancelToken cancel(
      [&](float) -> bool {
        if (++asked == 4) throw std::runtime_error("interrupted");
        return true;
      },
      milliseconds(0));
  ThreadPool pool(1);
  Query query;
  EXPECT_ANY_THROW(casting(Strategy::kAuto)(*snapshot, query, pool, cancel));
  EXPECT_THROW(cancel.rethrow_callback_error(), std::runtime_error);
}

TEST(CancellingAudit, IsAskedEverySoManyTests) {
  const auto snapshot = make_snapshot(TreeLayout::kDefault, false);
  Query query;
  std::vector<std::uint8_t> unclear(kRays);
  const AuditedAnswers answers{query.uvs.data(), query.ids.data(), query.ids.data()};
  std::size_t asked = 0;
  CancelToken cancel([&](float) { return ++asked < 1000; }, milliseconds(0));
  ThreadPool pool(1);
  const AuditVerdicts verdicts{query.flags.data(), unclear.data()};
  EXPECT_THROW(audit_answers(*snapshot, query.rays, answers, verdicts, pool, 0, cancel), Cancelled);
  EXPECT_EQ(asked, 1000u);
}

}  // namespace
}  // namespace perfect_bvh::test
