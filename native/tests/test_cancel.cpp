// Bounds the work between two polls for cancellation when rays are expensive, by counting instead of timing.
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <vector>

#include "query/audit.h"
#include "query/closest_points.h"
#include "query/trace.h"
#include "render/image/render.h"
#include "tests/scenes_to_trace.h"
#include "wide/run_cutter.h"

namespace perfect_bvh::test {
namespace {

using std::chrono::milliseconds;

// All triangles are equal: a ray that hits one tests all of them.
constexpr std::size_t kTriangles = 1024, kInstances = 2;
constexpr std::size_t kLeafVisits = kInstances * kTriangles / kLeafSize;  // per ray, at least

std::shared_ptr<const Snapshot> make_snapshot() {
  MeshData data;
  data.positions = {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}};
  data.triangles.assign(kTriangles, {0, 1, 2});
  Scene scene;
  BuildConfig config;
  std::vector<InstanceInput> inputs;
  for (std::size_t i = 0; i < kInstances; ++i) {
    const std::int32_t mesh = scene.add_mesh(data.mesh(), config, Usage::kStatic);
    inputs.push_back({mesh, Affine{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}, 1u, {}});
  }
  scene.add_instances(inputs);
  ThreadPool pool(1);
  CancelToken never;
  scene.commit(pool, never);
  return scene.snapshot();
}

// Rays from above and points, one per row, and memory for all results.
struct Query {
  explicit Query(std::size_t ray_count) : count(ray_count) {
    Random random(1);
    for (std::size_t i = 0; i < count; ++i) {
      origins.push_back({uniform(random, -0.2f, 0.2f), uniform(random, -0.2f, 0.2f), 1.0});
    }
    rays.count = count;
    rays.origins_double = origins.data(), rays.directions_double = directions.data();
    rays.t_min = &t_min, rays.t_max = &t_max, rays.masks = &mask;
    points = {count, origins.data(), &farthest, &mask, 0, 0};
    closest = {vectors.data(), t.data(), ids.data(), ids.data(), ids.data(), uvs.data()};
  }
  std::size_t count;
  std::vector<Vec3d> origins, directions = std::vector<Vec3d>(count, Vec3d{0.0, 0.0, -1.0});
  float t_min = 0.0f, t_max = 1e30f;
  double farthest = 1e30;
  std::uint32_t mask = 1;
  RayColumns rays;
  PointColumns points;
  std::vector<std::int32_t> ids = std::vector<std::int32_t>(count);
  std::vector<double> vectors = std::vector<double>(3 * count), t = std::vector<double>(count);
  std::vector<float> uvs = std::vector<float>(2 * count);
  std::vector<std::uint8_t> flags = std::vector<std::uint8_t>(count);
  ClosestColumns closest;
};

class Cancelling : public KernelTest {
 protected:
  struct Run {
    std::function<void(const Snapshot&, Query&, ThreadPool&, CancelToken&)> query;
    std::size_t rays_in_flight = 1;  // at most: a step visits at most one leaf for each

    // The number of rays for which at least `count` polls happen while they are traced.
    [[nodiscard]] std::size_t rays_for(std::size_t count) const {
      return count * kStepsBetweenAsking * rays_in_flight / kLeafVisits;
    }
  };

  static Run casting(Strategy strategy) {
    const auto cast = [strategy](const Snapshot& snapshot, Query& query, ThreadPool& pool, CancelToken& cancel) {
      query.rays.strategy = strategy;
      HitColumns out;
      out.instance_ids = query.ids.data();
      cast_rays(snapshot, query.rays, out, pool, 0, cancel);
    };
    return {cast, strategy == Strategy::kSingle ? 1 : kMostRaysInFlight};
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
    std::vector<Run> all{{count}, {list}, {find_closest}};
    for (const Strategy strategy : {Strategy::kAuto, Strategy::kPackets, Strategy::kStream, Strategy::kSingle}) {
      all.push_back(casting(strategy));
    }
    return all;
  }
};

INSTANTIATE_TEST_SUITE_P(All, Cancelling, testing::ValuesIn(kernel_names()), Cancelling::name_of);

TEST_P(Cancelling, IsAskedEverySoManyLeafVisits) {
  constexpr std::size_t kQuestions = 8;
  const auto snapshot = make_snapshot();
  const std::vector<Run> all = all_queries();
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::size_t asked = 0;
    CancelToken cancel([&](float) { return ++asked != 0; }, milliseconds(0));
    ThreadPool pool(1);
    Query query(all[i].rays_for(kQuestions));
    all[i].query(*snapshot, query, pool, cancel);
    EXPECT_GE(asked, kQuestions) << "query " << i;
  }
}

TEST_P(Cancelling, StopsAtTheQuestionThatSaysSo) {
  for (const Run& run : all_queries()) {
    const auto snapshot = make_snapshot();
    std::size_t asked = 0;
    CancelToken cancel([&](float) { return ++asked < 5; }, milliseconds(0));
    ThreadPool pool(1);
    Query query(run.rays_for(5));
    EXPECT_THROW(run.query(*snapshot, query, pool, cancel), Cancelled);
    EXPECT_EQ(asked, 5u);
  }
}

// The callback runs in the middle of a kernel, so the inner rays must not share the kernel's memory.
TEST_P(Cancelling, LetsTheCallbackCastRaysOfItsOwn) {
  for (const Run& run : all_queries()) {
    const std::size_t ray_count = run.rays_for(2);
    Query expected(ray_count);
    ThreadPool pool(1);
    CancelToken never;
    const auto snapshot = make_snapshot();
    run.query(*snapshot, expected, pool, never);
    Query query(ray_count);
    std::size_t asked = 0;
    CancelToken cancel(
        [&](float) {
          if (++asked != 2) return true;  // the first poll comes before the kernel runs
          Query other(70);
          casting(Strategy::kAuto).query(*snapshot, other, pool, never);
          find_closest(*snapshot, other, pool, never);
          return true;
        },
        milliseconds(0));
    run.query(*snapshot, query, pool, cancel);
    EXPECT_GE(asked, 2u);
    EXPECT_EQ(query.ids, expected.ids);
    EXPECT_EQ(query.t, expected.t);
  }
}

TEST_P(Cancelling, TellsWhatTheCallbackThrew) {
  const auto snapshot = make_snapshot();
  std::size_t asked = 0;
  CancelToken cancel(
      [&](float) -> bool {
        if (++asked == 4) throw std::runtime_error("interrupted");
        return true;
      },
      milliseconds(0));
  ThreadPool pool(1);
  const Run cast = casting(Strategy::kAuto);
  Query query(cast.rays_for(4));
  EXPECT_ANY_THROW(cast.query(*snapshot, query, pool, cancel));
  EXPECT_THROW(cancel.rethrow_callback_error(), std::runtime_error);
}

constexpr Mode kModes[] = {Mode::kPreview, Mode::kClay,     Mode::kMatcap,   Mode::kWireframe, Mode::kNormal, Mode::kUv,
                           Mode::kDepth,   Mode::kDistance, Mode::kInstance, Mode::kMaterial,  Mode::kCost};
constexpr int kPixels = 64;  // a side; each pixel sees the triangles

void render_mode(Mode mode, const Snapshot& snapshot, CancelToken& cancel) {
  constexpr std::int32_t kNoSlots[] = {0};
  Appearance appearance;
  appearance.slot_offsets = kNoSlots;
  appearance.finish();
  Camera camera;
  camera.camera_to_world = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 1}};
  RenderSettings settings;
  settings.mode = mode, settings.width = settings.height = kPixels, settings.threads = 1;
  std::vector<Rgba> pixels(kPixels * kPixels);
  PassTargets targets;
  targets.combined = pixels;
  static_cast<void>(render(snapshot, camera, appearance, settings, targets, cancel));
}

TEST(CancellingRender, IsAskedEverySoManyLeafVisitsInEachMode) {
  const auto snapshot = make_snapshot();
  constexpr std::size_t kVisits = kPixels * kPixels * kLeafVisits;  // of camera rays only
  for (const Mode mode : kModes) {
    std::size_t asked = 0;
    CancelToken cancel([&](float) { return ++asked != 0; }, milliseconds(0));
    render_mode(mode, *snapshot, cancel);
    EXPECT_GE(asked, kVisits / (kStepsBetweenAsking * kMostRaysInFlight)) << "mode " << static_cast<int>(mode);
  }
}

TEST(CancellingRender, StopsAtTheQuestionThatSaysSo) {
  const auto snapshot = make_snapshot();
  for (const Mode mode : kModes) {
    std::size_t asked = 0;
    CancelToken cancel([&](float) { return ++asked < 5; }, milliseconds(0));
    EXPECT_THROW(render_mode(mode, *snapshot, cancel), Cancelled);
    EXPECT_EQ(asked, 5u) << "mode " << static_cast<int>(mode);
  }
}

TEST(CancellingAudit, IsAskedEverySoManyTests) {
  const auto snapshot = make_snapshot();
  Query query(2048);
  const AuditedAnswers answers{query.uvs.data(), query.ids.data(), query.ids.data()};
  std::size_t asked = 0;
  CancelToken cancel([&](float) { return ++asked < 1000; }, milliseconds(0));
  ThreadPool pool(1);
  EXPECT_THROW(audit_answers(*snapshot, query.rays, answers, query.flags.data(), pool, 0, cancel), Cancelled);
  EXPECT_EQ(asked, 1000u);
}

}  // namespace
}  // namespace perfect_bvh::test
