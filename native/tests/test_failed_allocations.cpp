// Memory runs out at every single allocation of a commit or a query, on any thread. The committed state stays
// unchanged, the edits remain pending, and the next attempt succeeds.
#include <gtest/gtest.h>

#include <iterator>
#include <new>
#include <vector>

#include "core/errors.h"
#include "query/trace.h"
#include "tests/failing_memory.h"
#include "tests/scenes_to_trace.h"

namespace perfect_bvh::test {
namespace {

struct EditedScene {
  explicit EditedScene(ThreadPool& the_pool) : pool(the_pool) {
    deforming = scene.add_mesh(soup(120, 1).mesh(), {}, Usage::kDeforming);
    changing = scene.add_mesh(soup(60, 2).mesh(), {}, Usage::kChanging);
    still = scene.add_mesh(slivers(50, 3).mesh(), {}, Usage::kStatic);
    std::vector<InstanceInput> inputs;
    for (int i = 0; i < 40; ++i) {
      const std::int32_t mesh = i % 3 == 0 ? deforming : i % 3 == 1 ? changing : still;
      inputs.push_back({mesh, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.3 * i, 0, 0}}, 1, {}});
    }
    inputs.push_back({still, {{1, 0, 0}, {0, 0, 0}, {0, 0, 1}, {0, 2, 0}}, 1, {}});  // flattened: baked
    scene.add_instances(inputs);
    commit();
    for (int i = 0; i < 300; ++i) {
      Ray ray;
      ray.origin = {0.05 * i - 1.0, -4.0, 0.3};
      ray.direction = {0.0, 1.0, -0.05};
      rays.push_back(ray);
    }
  }

  CommitReport commit() {
    CancelToken cancel;
    return scene.commit(pool, cancel);
  }

  // Makes one edit of each kind: moved vertices, other triangles, a new mesh by every builder, a moved instance.
  void edit() {
    scene.update_mesh<float>(deforming, soup(120, 4).mesh().positions);
    scene.replace_mesh(changing, soup(70, 5).mesh());
    for (const auto& builder : kBuilders) {
      if (builder.kind == BuilderKind::kAuto) continue;
      BuildConfig config;
      config.builder = builder.kind, config.optimize_passes = 1;
      const auto added = scene.add_mesh(soup(30, 6).mesh(), config, Usage::kStatic);
      scene.add_instances(std::vector<InstanceInput>{{added, Affine{}, 1, {}}});
    }
    const Affine moved{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 1}};
    scene.set_transforms(std::vector{0}, std::vector{moved});
  }

  [[nodiscard]] std::vector<Hit> trace(const Snapshot& snapshot) const {
    std::vector<Hit> hits(rays.size());
    trace_closest(snapshot, rays, hits);
    return hits;
  }

  ThreadPool& pool;
  Scene scene;
  std::int32_t deforming, changing, still;
  std::vector<Ray> rays;
};

bool are_equal(const std::vector<Hit>& a, const std::vector<Hit>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Hit& x, const Hit& y) {
    return x.t == y.t && x.instance_index == y.instance_index && x.primitive_index == y.primitive_index;
  });
}

class Memory : public testing::TestWithParam<bool> {};

TEST_P(Memory, RunsOutDuringACommit) {
  ThreadPool pool(3);
  EditedScene edited(pool);
  const auto before = edited.scene.snapshot();
  const std::vector<Hit> old_hits = edited.trace(*before);
  edited.edit();
  int failures = 0;
  for (long allowed = 0;; ++allowed) {
    MemoryRunsOut fault(allowed, GetParam());
    try {
      const CommitReport report = edited.commit();
      const bool ran_out = fault.end();
      EXPECT_EQ(report.meshes.size(), 1 + std::size(kBuilders));
      if (ran_out) continue;  // less memory may only make it slower
      break;
    } catch (const std::bad_alloc&) {
      fault.end();
      ++failures;
    }
    ASSERT_THROW(static_cast<void>(edited.scene.snapshot()), StaleScene) << allowed;
  }
  EXPECT_GT(failures, 50);
  EXPECT_TRUE(are_equal(edited.trace(*before), old_hits));

  EditedScene fresh(pool);
  fresh.edit();
  fresh.commit();
  EXPECT_TRUE(are_equal(edited.trace(*edited.scene.snapshot()), fresh.trace(*fresh.scene.snapshot())));
}

TEST_P(Memory, RunsOutDuringAQuery) {
  ThreadPool pool(3);
  EditedScene edited(pool);
  const auto snapshot = edited.scene.snapshot();
  const std::vector<Hit> expected = edited.trace(*snapshot);
  std::vector<Vec3d> origins, directions;
  for (const Ray& ray : edited.rays) origins.push_back(ray.origin), directions.push_back(ray.direction);
  const float t_min = 0.0f, t_max = kInfiniteDistance;
  const std::uint32_t mask = 1;
  RayColumns columns;
  columns.count = origins.size();
  columns.origins_double = origins.data(), columns.directions_double = directions.data();
  columns.t_min = &t_min, columns.t_max = &t_max, columns.masks = &mask;
  std::vector<float> t(origins.size());
  HitColumns out;
  out.t = t.data();
  for (long allowed = 0;; ++allowed) {
    CancelToken cancel;
    MemoryRunsOut fault(allowed, GetParam());
    try {
      cast_rays(*snapshot, columns, out, pool, 0, cancel);
      if (!fault.end()) break;
    } catch (const std::bad_alloc&) {
      fault.end();
    }
  }
  for (std::size_t i = 0; i < t.size(); ++i) EXPECT_EQ(t[i], expected[i].t);
}

std::int32_t add_large(Scene& scene, std::uint32_t seed) {
  const auto id = scene.add_mesh(soup(20'000, seed).mesh(), {}, Usage::kStatic);
  scene.add_instances(std::vector<InstanceInput>{{id, Affine{}, 1, {}}});
  return id;
}

// An exception in a worker of the pool, while the committing thread has enough memory.
TEST(FailedWorkers, LeaveTheLastSnapshotWhole) {
  ThreadPool pool(3);
  EditedScene edited(pool);
  const auto large = add_large(edited.scene, 7);
  edited.commit();
  const auto before = edited.scene.snapshot();
  const std::vector<Hit> old_hits = edited.trace(*before);
  int failures = 0;
  for (int attempt = 0; failures < 5 && attempt < 300; ++attempt) {
    edited.scene.replace_mesh(large, soup(20'000, 8).mesh());
    MemoryRunsOut fault(attempt % 7, false, true);
    try {
      edited.commit();
    } catch (const std::bad_alloc&) {
      fault.end();
      ++failures;
      ASSERT_THROW(static_cast<void>(edited.scene.snapshot()), StaleScene);
    }
  }
  EXPECT_GT(failures, 0);
  EXPECT_TRUE(are_equal(edited.trace(*before), old_hits));

  edited.commit();
  EditedScene fresh(pool);
  add_large(fresh.scene, 8);
  fresh.commit();
  EXPECT_TRUE(are_equal(edited.trace(*edited.scene.snapshot()), fresh.trace(*fresh.scene.snapshot())));
}

INSTANTIATE_TEST_SUITE_P(FailedAllocations, Memory, testing::Values(false, true),
                         [](const auto& test) { return test.param ? "ForGood" : "Once"; });

}  // namespace
}  // namespace perfect_bvh::test
