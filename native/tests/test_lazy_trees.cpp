// Trees that are built when the first ray reaches them: the same answers, nothing more built than was reached, one
// build however many threads ask, and a fresh start after one that failed.
#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <limits>
#include <new>
#include <thread>

#include "blas/deferred_tree.h"
#include "core/errors.h"
#include "query/closest_points.h"
#include "query/intersections.h"
#include "query/trace.h"
#include "scene/scene.h"
#include "tests/scenes_to_trace.h"

namespace perfect_bvh::test {
namespace {

BuildConfig config_of(BuilderKind builder, TreeLayout layout) {
  BuildConfig config;
  config.builder = builder, config.layout = layout;
  return config;
}

// Some meshes of every builder, turned, mirrored, one of them flattened, and one without triangles.
std::shared_ptr<const Snapshot> make_crowd(bool is_lazy, TreeLayout layout = TreeLayout::kDefault) {
  Scene scene;
  std::vector<InstanceInput> inputs;
  std::uint32_t seed = 1;
  const auto add = [&](const MeshData& data, BuilderKind builder, Usage usage) {
    const std::int32_t mesh = scene.add_mesh(data.mesh(), config_of(builder, layout), usage, is_lazy);
    for (const Affine& place : many_places(4, seed++)) inputs.push_back({mesh, place, 1u << (seed % 3), {}});
  };
  add(soup(400, 1), BuilderKind::kAuto, Usage::kStatic);
  add(wide_soup(60, 2), BuilderKind::kSpatial, Usage::kStatic);
  add(soup(300, 3), BuilderKind::kAuto, Usage::kChanging);
  add(coincident(10, 4), BuilderKind::kMedian, Usage::kDeforming);
  add(slivers(30, 5), BuilderKind::kSweep, Usage::kStatic);
  add(MeshData{}, BuilderKind::kAuto, Usage::kStatic);
  inputs.push_back({0, {{1, 0, 0}, {0, 0, 0}, {0, 0, 1}, {0, 1, 0}}, 7u, {}});
  scene.add_instances(inputs);
  ThreadPool pool(1);
  CancelToken cancel;
  scene.commit(pool, cancel);
  return scene.snapshot();
}

std::vector<Ray> rays_from_near_and_far() {
  std::vector<Ray> rays = random_rays(1500, 7, 3.0);
  for (std::size_t i = 0; i < rays.size(); i += 3) {
    rays[i].origin = rays[i].origin - rays[i].direction * (0.5 * static_cast<double>(i % 40));
  }
  Ray camera;
  for (int i = 0; i < 1024; ++i) {  // neighbours, for packets
    camera.origin = {-20, 0.5, 0.25};
    camera.direction = {20, 0.1 * (i % 32 - 16), 0.1 * (i / 32 - 16)};
    rays.push_back(camera);
  }
  return rays;
}

std::size_t built_count(const Snapshot& snapshot) {
  std::size_t count = 0;
  for (const auto& [mesh_id, blas] : snapshot.meshes) count += newest_of(*blas).deferred ? 0 : 1;
  return count;
}

void expect_same(const std::vector<Hit>& lazy, const std::vector<Hit>& eager) {
  std::size_t found = 0;
  for (std::size_t i = 0; i < eager.size(); ++i) {
    ASSERT_EQ(std::memcmp(&lazy[i], &eager[i], sizeof(Hit)), 0) << "ray " << i;
    found += eager[i].found() ? 1 : 0;
  }
  EXPECT_GT(found, eager.size() / 10);
}

class LazyTreesOnEveryIsa : public KernelTest {
 protected:
  static std::shared_ptr<const Snapshot> crowd(bool is_lazy) { return make_crowd(is_lazy, GetParam().layout); }
};

TEST_P(LazyTreesOnEveryIsa, RaysHitWhatTheyHitInABuiltScene) {
  const auto eager = crowd(false);
  const auto rays = rays_from_near_and_far();
  for (const Strategy strategy : {Strategy::kAuto, Strategy::kPackets, Strategy::kStream, Strategy::kSingle}) {
    for (const Cull cull : {Cull::kNone, Cull::kBack}) {
      std::vector<Hit> expected(rays.size()), hits(rays.size());
      trace_closest(*eager, rays, expected, cull, {}, strategy);
      const auto lazy = crowd(true);
      ASSERT_EQ(built_count(*lazy), 0u);
      trace_closest(*lazy, rays, hits, cull, {}, strategy);
      expect_same(hits, expected);
      EXPECT_EQ(built_count(*lazy), 5u);  // all that have triangles
      std::vector<std::uint8_t> expected_any(rays.size()), any(rays.size());
      trace_occluded(*eager, rays, expected_any, cull, {}, strategy);
      trace_occluded(*crowd(true), rays, any, cull, {}, strategy);
      EXPECT_EQ(any, expected_any);
    }
  }
}

TEST_P(LazyTreesOnEveryIsa, AllThatARayMeetsIsCounted) {
  const auto rays = rays_from_near_and_far();
  std::vector<Vec3d> origins, directions;
  for (const Ray& ray : rays) origins.push_back(ray.origin), directions.push_back(ray.direction);
  const float t_min = 0.0f, t_max = kInfiniteDistance;
  const std::uint32_t mask = 7;
  RayColumns columns;
  columns.count = rays.size();
  columns.origins_double = origins.data(), columns.directions_double = directions.data();
  columns.t_min = &t_min, columns.t_max = &t_max, columns.masks = &mask;
  ThreadPool pool(2);
  CancelToken cancel;
  std::vector<std::int32_t> expected(rays.size()), counts(rays.size());
  count_intersections(*crowd(false), columns, expected.data(), pool, 0, cancel);
  count_intersections(*crowd(true), columns, counts.data(), pool, 0, cancel);
  EXPECT_EQ(counts, expected);

  std::vector<std::int64_t> splits(rays.size() + 1, 0);
  for (std::size_t i = 0; i < rays.size(); ++i) splits[i + 1] = splits[i] + expected[i];
  std::vector<float> expected_t(static_cast<std::size_t>(splits.back())), t(expected_t.size());
  HitColumns out;
  out.t = expected_t.data();
  list_intersections(*crowd(false), columns, splits, out, pool, 0, cancel);
  out.t = t.data();
  list_intersections(*crowd(true), columns, splits, out, pool, 0, cancel);
  EXPECT_EQ(t, expected_t);
}

TEST_P(LazyTreesOnEveryIsa, TheNearestPointIsThatOfABuiltScene) {
  Random random(9);
  std::vector<Vec3d> points(400);
  for (Vec3d& point : points) point = to_double(random_point(random, 6.0f));
  const double farthest = std::numeric_limits<double>::infinity();
  const std::uint32_t mask = 7;
  const PointColumns columns{points.size(), points.data(), &farthest, &mask, 0, 0};
  ThreadPool pool(2);
  const auto ask = [&](const Snapshot& snapshot) {
    struct Answers {
      std::vector<double> points, distances;
      std::vector<std::int32_t> instances, meshes, primitives;
      std::vector<float> uvs;
      bool operator==(const Answers&) const = default;
    } found;
    found.points.resize(3 * points.size()), found.distances.resize(points.size()), found.uvs.resize(2 * points.size());
    for (auto* ids : {&found.instances, &found.meshes, &found.primitives}) ids->resize(points.size());
    CancelToken cancel;
    compute_closest_points(snapshot, columns,
                           {found.points.data(), found.distances.data(), found.instances.data(), found.meshes.data(),
                            found.primitives.data(), found.uvs.data()},
                           pool, 0, cancel);
    return found;
  };
  EXPECT_EQ(ask(*crowd(true)), ask(*crowd(false)));
}

INSTANTIATE_TEST_SUITE_P(All, LazyTreesOnEveryIsa, testing::ValuesIn(kernel_cases()), KernelTest::name_of);

// A tetrahedron of size 1 at each of these heights, one mesh each.
Scene& add_tower(Scene& scene, const std::vector<double>& heights, std::size_t detail = 1) {
  std::vector<InstanceInput> inputs;
  for (const double height : heights) {
    MeshData data;
    for (std::size_t i = 0; i < detail; ++i) {
      const float z = 0.001f * static_cast<float>(i);
      data.add({-1, -1, z}, {1, -1, z}, {0, 1, z});
    }
    const auto mesh = scene.add_mesh(data.mesh(), {}, Usage::kStatic, true);
    inputs.push_back({mesh, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, height}}, 1, {}});
  }
  scene.add_instances(inputs);
  return scene;
}

CommitReport commit(Scene& scene) {
  ThreadPool pool(1);
  CancelToken cancel;
  return scene.commit(pool, cancel);
}

Ray down_from(double height) {
  Ray ray;
  ray.origin = {0, 0, height}, ray.direction = {0, 0, -1};
  return ray;
}

TEST(LazyTrees, OnlyWhatRaysReachIsBuilt) {
  for (const Strategy strategy : {Strategy::kPackets, Strategy::kStream}) {
    Scene scene;
    const CommitReport report = commit(add_tower(scene, {0, 10, 20, 30}));
    for (const MeshReport& mesh : report.meshes) EXPECT_EQ(mesh.action, MeshAction::kDeferred);
    const auto snapshot = scene.snapshot();
    const std::vector<Ray> rays(64, down_from(15));
    std::vector<Hit> hits(rays.size());
    trace_closest(*snapshot, rays, hits, Cull::kNone, {}, strategy);
    for (const Hit& hit : hits) ASSERT_EQ(hit.instance_index, 1u);
    EXPECT_EQ(built_count(*snapshot), 1u);
    std::vector<std::uint8_t> occluded(1);
    Ray miss = down_from(15);
    miss.origin.x = 3;
    trace_occluded(*snapshot, {&miss, 1}, occluded);
    EXPECT_EQ(occluded[0], 0);
    EXPECT_EQ(built_count(*snapshot), 1u);
  }
}

TEST(LazyTrees, ManyThreadsShareASnapshot) {
  const auto eager = make_crowd(false);
  const auto rays = rays_from_near_and_far();
  std::vector<Hit> expected(rays.size());
  trace_closest(*eager, rays, expected);
  const auto lazy = make_crowd(true);
  std::vector<std::vector<Hit>> hits(8, std::vector<Hit>(rays.size()));
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    threads.emplace_back([&, i] {
      for (std::size_t first = 0; first < rays.size(); first += 100) {
        const std::size_t count = std::min<std::size_t>(100, rays.size() - first);
        trace_closest(*lazy, std::span(rays).subspan(first, count), std::span(hits[i]).subspan(first, count));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const auto& answers : hits) expect_same(answers, expected);
}

TEST(LazyTrees, ACancelledQueryLeavesTheTreeToTheNext) {
  Scene scene;
  commit(add_tower(scene, {0}, 20'000));
  const auto snapshot = scene.snapshot();
  const Ray ray = down_from(50);
  Hit hit;
  CancelToken stopped;
  stopped.request_stop();
  EXPECT_THROW(trace_closest(*snapshot, stopped, {&ray, 1}, {&hit, 1}), Cancelled);
  EXPECT_EQ(built_count(*snapshot), 0u);
  trace_closest(*snapshot, {&ray, 1}, {&hit, 1});
  EXPECT_TRUE(hit.found());
  EXPECT_EQ(built_count(*snapshot), 1u);
}

TEST(LazyTrees, SnapshotsOutliveTheScenesEdits) {
  Scene scene;
  commit(add_tower(scene, {0, 10}));
  const auto before = scene.snapshot();
  const std::int32_t lower = before->instances[0].mesh_id;
  MeshData wide;
  wide.add({-9, -9, 0}, {9, -9, 0}, {0, 9, 0});
  scene.replace_mesh(lower, wide.mesh());
  scene.remove_instances(std::vector{before->instances[1].id});
  scene.remove_mesh(before->instances[1].mesh_id);
  const CommitReport report = commit(scene);
  ASSERT_EQ(report.meshes.size(), 1u);
  EXPECT_EQ(report.meshes[0].action, MeshAction::kDeferred);
  Ray ray = down_from(5);
  ray.origin.x = 3;
  Hit hit;
  trace_closest(*scene.snapshot(), {&ray, 1}, {&hit, 1});
  EXPECT_EQ(hit.t, 5.0f);
  trace_closest(*before, {&ray, 1}, {&hit, 1});
  EXPECT_FALSE(hit.found());
  ray = down_from(15);
  trace_closest(*before, {&ray, 1}, {&hit, 1});
  EXPECT_EQ(hit.instance_index, 1u);
  trace_closest(*scene.snapshot(), {&ray, 1}, {&hit, 1});
  EXPECT_EQ(hit.t, 15.0f);
}

TEST(LazyTrees, AMeshThatWasReachedIsTreatedLikeAnyOther) {
  Scene scene;
  const std::int32_t mesh = scene.add_mesh(soup(200, 1).mesh(), {}, Usage::kDeforming, true);
  scene.add_instances(std::vector<InstanceInput>{{mesh, Affine{}, 1, {}}});
  commit(scene);
  const auto move = [&](float by) {
    std::vector<Vec3f> positions = soup(200, 1).positions;
    for (Vec3f& p : positions) p.x += by;
    scene.update_mesh(mesh, std::span<const Vec3f>(positions));
    return commit(scene).meshes.at(0).action;
  };
  EXPECT_EQ(move(0.1f), MeshAction::kDeferred);
  const auto first = scene.snapshot();
  const std::vector<Ray> rays = random_rays(200, 3);
  std::vector<Hit> hits(rays.size());
  trace_closest(*first, rays, hits);
  EXPECT_EQ(built_count(*first), 1u);
  EXPECT_EQ(move(0.2f), MeshAction::kRefitted);
  EXPECT_EQ(scene.snapshot()->lazy_trees, nullptr);
}

BuiltTree some_tree() { return {std::make_shared<const Blas>(std::make_shared<const Mesh>()), {}}; }

TEST(DeferredTree, IsBuiltOnceHoweverManyAsk) {
  std::atomic<int> builds{0};
  DeferredTree tree([&](ThreadPool& pool, CancelToken&) {
    ++builds;
    parallel_for(pool, 16, 1, [](std::size_t, std::size_t) { std::this_thread::yield(); });
    return some_tree();
  });
  std::vector<const Blas*> got(8);
  std::vector<std::thread> threads;
  for (const Blas*& blas : got) {
    threads.emplace_back([&] {
      CancelToken cancel;
      blas = &tree.get(ThreadPool::shared(), cancel);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(builds, 1);
  for (const Blas* blas : got) EXPECT_EQ(blas, got[0]);
}

TEST(DeferredTree, IsLeftToTheNextByOneThatFails) {
  int attempts = 0;
  DeferredTree tree([&](ThreadPool&, CancelToken&) {
    if (++attempts == 1) throw std::bad_alloc();
    return some_tree();
  });
  CancelToken cancel;
  EXPECT_THROW(static_cast<void>(tree.get(ThreadPool::shared(), cancel)), std::bad_alloc);
  EXPECT_EQ(tree.if_built().blas, nullptr);
  const Blas& built = tree.get(ThreadPool::shared(), cancel);
  EXPECT_EQ(&built, tree.if_built().blas.get());
  EXPECT_EQ(attempts, 2);
}

// The one that builds is stopped while another waits: the other takes over.
TEST(DeferredTree, IsTakenOverFromOneThatIsStopped) {
  std::atomic<int> attempts{0};
  CancelToken stopped;
  std::atomic<bool> other_asks{false};
  DeferredTree tree([&](ThreadPool&, CancelToken& cancel) {
    if (++attempts > 1) return some_tree();
    while (!other_asks) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    stopped.request_stop();
    for (;;) {
      cancel.throw_if_stopped();
      cancel.poll();
      std::this_thread::yield();
    }
  });
  std::thread first([&] { EXPECT_THROW(static_cast<void>(tree.get(ThreadPool::shared(), stopped)), Cancelled); });
  while (attempts == 0) std::this_thread::yield();
  other_asks = true;
  CancelToken goes_on;
  const Blas& built = tree.get(ThreadPool::shared(), goes_on);
  EXPECT_EQ(&built, tree.if_built().blas.get());
  first.join();
  EXPECT_EQ(attempts, 2);
}

}  // namespace
}  // namespace perfect_bvh::test
