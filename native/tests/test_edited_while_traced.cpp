// Two scenes are edited, committed, stopped and made stale at random, while other threads trace all snapshots that they
// can get and keep some of them. For sanitizers, and to check that a snapshot never changes.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <deque>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/errors.h"
#include "query/trace.h"
#include "scene/scene.h"
#include "tests/mesh_sets.h"
#include "tests/scenes_to_trace.h"

namespace perfect_bvh::test {
namespace {

using SnapshotPointer = std::shared_ptr<const Snapshot>;

std::vector<Ray> rays_around(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  std::vector<Ray> rays(count);
  for (Ray& ray : rays) {
    const Vec3f from = random_point(random, 6.0f), to = random_point(random, 4.0f) - from;
    ray.origin = {from.x, from.y, from.z};
    ray.direction = {to.x, to.y, to.z};
  }
  return rays;
}

std::vector<Hit> trace(const Snapshot& snapshot, const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  trace_closest(snapshot, rays, hits);
  return hits;
}

int count_differences(const std::vector<Hit>& one, const std::vector<Hit>& other) {
  int differences = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    const bool is_same =
        one[i].found() == other[i].found() &&
        (!one[i].found() || (one[i].t == other[i].t && one[i].primitive_index == other[i].primitive_index));
    differences += is_same ? 0 : 1;
  }
  return differences;
}

Affine placed(Random& random) {
  const Vec3f at = random_point(random, 3.0f);
  return {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {at.x, at.y, at.z}};
}

// A scene and its expected content.
class EditedScene {
 public:
  explicit EditedScene(std::uint32_t seed) : random_(seed) {
    for (int i = 0; i < 3; ++i) add();
  }

  void edit_and_commit(ThreadPool& pool) {
    for (auto edits = 1 + random_() % 3; edits > 0; --edits) edit();
    CancelToken cancel;
    if (random_() % 4 == 0) cancel.request_stop();
    try {
      static_cast<void>(scene.commit(pool, cancel));
    } catch (const Cancelled&) {
      ++stopped_count;
    }
  }

  // Creates another scene with the same meshes and instances, which was never edited.
  [[nodiscard]] std::vector<Hit> trace_again(ThreadPool& pool, const std::vector<Ray>& rays) const {
    Scene fresh;
    for (const Part& part : parts_) {
      const auto mesh = fresh.add_mesh(Mesh(part.mesh), {}, Usage::kStatic);
      fresh.add_instances(std::vector<InstanceInput>{{mesh, part.transform, 1, {}}});
    }
    CancelToken cancel;
    static_cast<void>(fresh.commit(pool, cancel));
    return trace(*fresh.snapshot(), rays);
  }

  Scene scene;
  int stopped_count = 0;

 private:
  struct Part {
    std::int32_t mesh_id, instance_id;
    Mesh mesh;
    Affine transform;
  };

  void add() {
    Mesh mesh = triangle_soup(300 + random_() % 300, 0.2f, ++soup_seed_);
    const Affine transform = placed(random_);
    const auto id = scene.add_mesh(Mesh(mesh), {}, random_() % 4 == 0 ? Usage::kStatic : Usage::kDeforming);
    const auto instance = scene.add_instances(std::vector<InstanceInput>{{id, transform, 1, {}}});
    parts_.push_back({id, instance, std::move(mesh), transform});
  }

  void remove() {
    scene.remove_instances(std::vector{parts_.front().instance_id});
    scene.remove_mesh(parts_.front().mesh_id);
    parts_.erase(parts_.begin());
  }

  void edit() {
    Part& part = parts_[random_() % parts_.size()];
    switch (random_() % 6) {
      case 0:
        part.transform = placed(random_);
        scene.set_transforms(std::vector{part.instance_id}, std::vector{part.transform});
        break;
      case 1:
        for (Vec3f& p : part.mesh.positions) p = p + random_point(random_, 0.05f);
        scene.update_mesh<float>(part.mesh_id, part.mesh.positions);
        break;
      case 2:
        part.mesh = triangle_soup(200 + random_() % 300, 0.2f, ++soup_seed_);
        scene.replace_mesh(part.mesh_id, Mesh(part.mesh));
        break;
      case 3:
        if (parts_.size() < 6) add();
        break;
      case 4:
        if (parts_.size() > 1) remove();
        break;
      default:
        scene.mark_stale("a test says so");
    }
  }

  Random random_;
  std::uint32_t soup_seed_ = 0;
  std::vector<Part> parts_;
};

// Traces the current snapshots until it is stopped, keeps some of them, and traces those again. Counts differences.
int trace_until(const std::atomic<bool>& is_over, const EditedScene& edited, std::atomic<int>& traced_count) {
  const std::vector<Ray> rays = rays_around(200, 5);
  std::deque<std::pair<SnapshotPointer, std::vector<Hit>>> kept;
  int differences = 0;
  while (!is_over) {
    try {
      SnapshotPointer snapshot = edited.scene.snapshot();
      std::vector<Hit> hits = trace(*snapshot, rays);
      kept.emplace_back(std::move(snapshot), std::move(hits));
      ++traced_count;
    } catch (const StaleScene&) {
      std::this_thread::yield();
    }
    if (kept.empty()) continue;
    differences += count_differences(trace(*kept.front().first, rays), kept.front().second);
    if (kept.size() > 3) kept.pop_front();
  }
  return differences;
}

TEST(EditedWhileTraced, SnapshotsNeverChangeAndTheLastIsRight) {
  ThreadPool pool(3);
  EditedScene one(1), other(2);
  std::atomic<bool> is_over{false};
  std::atomic<int> differences{0}, traced_count{0};
  std::vector<std::thread> tracers;
  for (const EditedScene* edited : {&one, &other, &one}) {
    tracers.emplace_back([&, edited] { differences += trace_until(is_over, *edited, traced_count); });
  }
  std::vector<std::thread> editors;
  for (EditedScene* edited : {&one, &other}) {
    editors.emplace_back([&, edited] {
      for (int step = 0; step < 150 || traced_count == 0; ++step) {  // even if the other threads start late
        edited->edit_and_commit(pool);
        std::this_thread::sleep_for(std::chrono::microseconds(200));  // so that other threads see the committed scene
      }
    });
  }
  for (std::thread& editor : editors) editor.join();
  is_over = true;
  for (std::thread& tracer : tracers) tracer.join();
  EXPECT_EQ(differences.load(), 0);

  const std::vector<Ray> rays = rays_around(2000, 6);
  for (EditedScene* edited : {&one, &other}) {
    EXPECT_GT(edited->stopped_count, 0);
    CancelToken cancel;
    static_cast<void>(edited->scene.commit(pool, cancel));
    const std::vector<Hit> hits = trace(*edited->scene.snapshot(), rays);
    EXPECT_EQ(count_differences(hits, edited->trace_again(pool, rays)), 0);
  }
}

TEST(EditedWhileTraced, AnErrorAmidACommitLeavesTheLastSnapshotWhole) {
  ThreadPool pool(3);
  Scene scene;
  const auto mesh = scene.add_mesh(triangle_soup(20'000, 0.05f, 1), {}, Usage::kStatic);
  scene.add_instances(std::vector<InstanceInput>{{mesh, Affine{}, 1, {}}});
  CancelToken calm;
  static_cast<void>(scene.commit(pool, calm));
  const SnapshotPointer before = scene.snapshot();
  const std::vector<Ray> rays = rays_around(500, 7);
  const std::vector<Hit> expected = trace(*before, rays);

  scene.replace_mesh(mesh, triangle_soup(200'000, 0.05f, 2));
  CancelToken failing([](float) -> bool { throw std::runtime_error("the panel is gone"); });
  std::this_thread::sleep_for(std::chrono::milliseconds(60));  // long enough that the first poll calls back
  EXPECT_THROW(static_cast<void>(scene.commit(pool, failing)), std::runtime_error);
  EXPECT_THROW(static_cast<void>(scene.snapshot()), StaleScene);
  EXPECT_EQ(count_differences(trace(*before, rays), expected), 0);

  static_cast<void>(scene.commit(pool, calm));
  EXPECT_EQ(scene.snapshot()->blases[0]->mesh.primitive_count(), 200'000u);
}

}  // namespace
}  // namespace perfect_bvh::test
