// The scene under threads, cancellation and injected failures: cases that Python tests cannot run under sanitizers.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <thread>
#include <vector>

#include "core/errors.h"
#include "query/trace.h"
#include "scene/scene.h"

namespace perfect_bvh {
namespace {

// A bumpy sheet over [0, 1]^2, `height` above the plane z = 0.
Mesh sheet(int cells, float height) {
  std::vector<Vec3f> positions;
  std::vector<Vec3<std::int32_t>> triangles;
  for (int y = 0; y <= cells; ++y) {
    for (int x = 0; x <= cells; ++x) {
      const float u = static_cast<float>(x) / static_cast<float>(cells),
                  v = static_cast<float>(y) / static_cast<float>(cells);
      positions.push_back({u, v, height + 0.05f * std::sin(9.0f * u) * std::cos(7.0f * v)});
    }
  }
  for (int y = 0; y < cells; ++y) {
    for (int x = 0; x < cells; ++x) {
      const int corner = y * (cells + 1) + x;
      triangles.push_back({corner, corner + 1, corner + cells + 2});
      triangles.push_back({corner, corner + cells + 2, corner + cells + 1});
    }
  }
  return make_mesh(positions, triangles, "test");
}

std::vector<Ray> downward_rays(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(0.01, 0.99), tilt(-0.2, 0.2);
  std::vector<Ray> rays(count);
  for (Ray& ray : rays) {
    ray.origin = {place(random), place(random), 3.0};
    ray.direction = {tilt(random) * 0.01, tilt(random) * 0.01, -1.0};
  }
  return rays;
}

CommitReport commit(Scene& scene, ThreadPool& pool) {
  CancelToken cancel;
  return scene.commit(pool, cancel);
}

TEST(Scene, EveryRayMeetsTheSheet) {
  ThreadPool pool(2);
  Scene scene;
  const auto mesh = scene.add_mesh(sheet(30, 0.0f), {}, Usage::kStatic);
  scene.add_instances(std::vector<InstanceInput>{{mesh, Affine{}, 1, {}}});
  commit(scene, pool);
  const auto rays = downward_rays(5000, 1);
  std::vector<Hit> hits(rays.size());
  trace_closest(*scene.snapshot(), rays, hits);
  for (const Hit& hit : hits) {
    ASSERT_TRUE(hit.found());
    EXPECT_NEAR(hit.t, 3.0f, 0.06f);
  }
}

TEST(Scene, ACancelledCommitLeavesEditsWaiting) {
  ThreadPool pool(2);
  Scene scene;
  const auto mesh = scene.add_mesh(sheet(10, 0.0f), {}, Usage::kStatic);
  scene.add_instances(std::vector<InstanceInput>{{mesh, Affine{}, 1, {}}});
  commit(scene, pool);
  const auto before = scene.snapshot();
  scene.replace_mesh(mesh, sheet(40, 1.0f));
  CancelToken cancel;
  cancel.request_stop();
  EXPECT_THROW(static_cast<void>(scene.commit(pool, cancel)), Cancelled);
  EXPECT_THROW(static_cast<void>(scene.snapshot()), StaleScene);
  EXPECT_EQ(before->instances[0].blas->mesh.primitive_count(), 200u);
  EXPECT_EQ(commit(scene, pool).meshes.size(), 1u);
  EXPECT_EQ(scene.snapshot()->instances[0].blas->mesh.primitive_count(), 3200u);
}

TEST(Scene, AMarkDuringACommitIsNotLost) {
  ThreadPool pool(2);
  Scene scene;
  scene.add_mesh(sheet(150, 0.0f), {}, Usage::kStatic);
  CancelToken cancel([&](float) {
    scene.mark_stale("changed during the commit");
    return true;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(60));  // long enough that the first poll calls back
  static_cast<void>(scene.commit(pool, cancel));
  EXPECT_THROW(static_cast<void>(scene.snapshot()), StaleScene);
  commit(scene, pool);
  EXPECT_NO_THROW(static_cast<void>(scene.snapshot()));
}

TEST(RayBatch, EqualsOneByOneForAnyThreadCount) {
  ThreadPool pool(3);
  Scene scene;
  const auto mesh = scene.add_mesh(sheet(30, 0.0f), {}, Usage::kStatic);
  scene.add_instances(std::vector<InstanceInput>{{mesh, Affine{}, 1, {}}});
  commit(scene, pool);
  const auto rays = downward_rays(20'000, 3);
  std::vector<Vec3d> origins, directions;
  for (const Ray& ray : rays) origins.push_back(ray.origin), directions.push_back(ray.direction);
  const float t_min = 0.0f, t_max = kInfiniteDistance;
  const std::uint32_t mask = 1;
  RayColumns columns;
  columns.count = rays.size();
  columns.origins_double = origins.data(), columns.directions_double = directions.data();
  columns.t_min = &t_min, columns.t_max = &t_max, columns.masks = &mask;
  std::vector<Hit> expected(rays.size());
  trace_closest(*scene.snapshot(), rays, expected);
  for (const int threads : {1, 2, 3}) {
    std::vector<float> t(rays.size());
    std::vector<std::uint8_t> occluded(rays.size());
    HitColumns out;
    out.t = t.data();
    CancelToken cancel;
    EXPECT_EQ(cast_rays(*scene.snapshot(), columns, out, pool, threads, cancel).invalid_count, 0u);
    EXPECT_EQ(test_occlusions(*scene.snapshot(), columns, occluded.data(), pool, threads, cancel), 0u);
    for (std::size_t i = 0; i < t.size(); ++i) {
      ASSERT_EQ(t[i], expected[i].t);
      ASSERT_EQ(occluded[i], 1);
    }
  }
}

// A task has whole blocks, so that blocks begin at the same rays as on one thread; and each thread gets two tasks, if
// there are enough blocks.
TEST(RayBatch, IsSharedOutFairly) {
  for (const std::size_t block : {kBlockRays, std::size_t{6208}, kReorderedRays}) {
    for (const std::size_t count : {1, 1000, 1025, 5000, 16'384, 100'000, 1'000'000}) {
      for (const std::size_t threads : {1, 2, 3, 16, 200}) {
        const std::size_t task = fair_task_rays(count, block, threads);
        EXPECT_EQ(task % block, 0u);
        EXPECT_GE(task, block);
        EXPECT_LE(task, std::max(kTaskRays, block));
        const std::size_t blocks = (count + block - 1) / block, tasks = (count + task - 1) / task;
        EXPECT_GE(tasks, std::min(blocks, 2 * threads)) << count << " rays, " << threads << " threads";
      }
    }
  }
}

TEST(Mesh, RefusesWhatItCannotHold) {
  const std::vector<Vec3f> positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<Vec3<std::int32_t>> triangles{{0, 1, 3}};
  EXPECT_THROW(static_cast<void>(make_mesh(positions, triangles, "test")), InvalidArgument);
  const std::vector<Vec3f> broken{{0, 0, NAN}};
  EXPECT_THROW(static_cast<void>(make_mesh(broken, {}, "test")), InvalidArgument);
}

}  // namespace
}  // namespace perfect_bvh
