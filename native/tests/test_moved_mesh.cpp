// Vertices that move from commit to commit: triangles are shared, memory of positions is reused only when no reader can
// see it, and neither affects any tree or hit.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <deque>
#include <limits>
#include <memory>
#include <random>
#include <set>
#include <thread>
#include <vector>

#include "core/errors.h"
#include "query/trace.h"
#include "scene/scene.h"
#include "tests/failing_memory.h"
#include "tests/mesh_sets.h"
#include "tests/motions.h"
#include "tests/same_bytes.h"

namespace perfect_bvh::test {
namespace {

using SnapshotPointer = std::shared_ptr<const Snapshot>;

// One deforming mesh, and its positions in each frame.
struct MovingScene {
  explicit MovingScene(ThreadPool& the_pool, std::uint32_t side = 40) : pool(the_pool), mesh(bumpy_sheet(side)) {
    id = scene.add_mesh(mesh, {}, Usage::kDeforming);
    scene.add_instances(std::vector<InstanceInput>{{id, Affine{}, 1, {}}});
    commit();
  }
  [[nodiscard]] Positions positions(int frame) const {
    Positions moved = mesh.positions;
    scatter(moved, 0.01f, static_cast<std::uint32_t>(frame) + 1);
    return moved;
  }
  SnapshotPointer commit() {
    CancelToken cancel;
    scene.commit(pool, cancel);
    return scene.snapshot();
  }
  SnapshotPointer show(int frame) {
    const Positions moved = positions(frame);
    scene.update_mesh<float>(id, moved, pool);
    return commit();
  }

  ThreadPool& pool;
  Mesh mesh;
  Scene scene;
  std::int32_t id = -1;
};

const Mesh& mesh_of(const Snapshot& snapshot) { return snapshot.blases.front()->mesh; }

bool holds(const Snapshot& snapshot, const Positions& positions) {
  const auto& held = mesh_of(snapshot).positions;
  return held.size() == positions.size() &&
         std::memcmp(held.data(), positions.data(), positions.size() * sizeof(Vec3f)) == 0;
}

TEST(MovedMesh, SharesTheTrianglesAndUsesMemoryAgain) {
  ThreadPool pool(2);
  MovingScene moving(pool);
  const TriangleIndices* const triangles = mesh_of(*moving.scene.snapshot()).triangles.data();
  EXPECT_EQ(triangles, moving.mesh.triangles.data());
  std::set<const Vec3f*> places;
  std::vector<Positions> others;  // take the memory that was released
  for (int frame = 0; frame < 12; ++frame) {
    const SnapshotPointer snapshot = moving.show(frame);
    EXPECT_EQ(mesh_of(*snapshot).triangles.data(), triangles);
    ASSERT_TRUE(holds(*snapshot, moving.positions(frame))) << frame;
    places.insert(mesh_of(*snapshot).positions.data());
    others.push_back(mesh_of(*snapshot).positions), others.push_back(others.back());
  }
  EXPECT_LE(places.size(), 4u) << "two are handed to and fro";
}

TEST(MovedMesh, MemoryComesBackWithTheLastHolder) {
  ThreadPool pool(1);
  const Mesh mesh = bumpy_sheet(10);
  const auto spare = std::make_shared<SparePositions>();
  auto first = move_vertices<float>(mesh, mesh.positions, spare, pool, "test");
  const Vec3f* const place = first->positions.data();
  auto other_holder = first;
  first.reset();
  EXPECT_TRUE(spare->take().positions.empty());
  other_holder.reset();
  const auto second = move_vertices<float>(mesh, mesh.positions, spare, pool, "test");
  EXPECT_EQ(second->positions.data(), place);
  EXPECT_TRUE(spare->take().positions.empty());
}

TEST(MovedMesh, WhatASnapshotHoldsIsNeverOverwritten) {
  ThreadPool pool(2);
  MovingScene moving(pool), alone(pool);
  std::deque<std::pair<int, SnapshotPointer>> held;
  std::mt19937 random(5);
  for (int frame = 0; frame < 60; ++frame) {
    const SnapshotPointer snapshot = moving.show(frame);
    for (const auto& [other_frame, other] : held) {
      ASSERT_NE(mesh_of(*other).positions.data(), mesh_of(*snapshot).positions.data());
      ASSERT_TRUE(holds(*other, moving.positions(other_frame))) << other_frame << " was overwritten by " << frame;
    }
    held.emplace_back(frame, snapshot);
    while (held.size() > 1 && random() % 2 == 0) held.erase(held.begin() + random() % held.size());
    // Held snapshots do not change any byte of a tree.
    alone.show(frame);
    const WideBvh &tree = snapshot->blases.front()->wide, &other = alone.scene.snapshot()->blases.front()->wide;
    ASSERT_TRUE(same_bytes(tree.nodes, other.nodes)) << frame;
    ASSERT_TRUE(same_bytes(tree.blocks, other.blocks)) << frame;
  }
}

TEST(MovedMesh, OthersReadWhileItMoves) {
  ThreadPool pool(2);
  MovingScene moving(pool, 25);
  std::vector<Positions> frames;
  for (int frame = 0; frame < 8; ++frame) frames.push_back(moving.positions(frame));
  moving.show(0);
  std::atomic<bool> is_over{false};
  std::atomic<int> torn{0}, seen{0};
  const auto watch = [&] {
    SnapshotPointer kept;
    while (!is_over) {
      try {
        kept = moving.scene.snapshot();
      } catch (const StaleScene&) {
        if (!kept) continue;  // otherwise check the old one once more, while the next is being made
      }
      const bool is_whole =
          std::any_of(frames.begin(), frames.end(), [&](const Positions& frame) { return holds(*kept, frame); });
      torn += is_whole ? 0 : 1;
      ++seen;
    }
  };
  std::thread first(watch), second(watch);
  for (int round = 0; round < 300 || (seen < 50 && round < 100000); ++round) moving.show(round % 8);
  is_over = true;
  first.join(), second.join();
  EXPECT_EQ(torn, 0);
  EXPECT_GT(seen, 0);
}

TEST(MovedMesh, BadPositionsLeaveItAsItWas) {
  ThreadPool pool(2);
  MovingScene moving(pool);
  moving.show(0), moving.show(1);
  for (const float wrong : {std::numeric_limits<float>::quiet_NaN(), -2e18f, Aabb::kInfinity}) {
    Positions positions = moving.positions(2);
    positions[positions.size() - 2].y = wrong;
    EXPECT_THROW(moving.scene.update_mesh<float>(moving.id, positions, pool), InvalidArgument);
    EXPECT_TRUE(moving.scene.is_current());
    EXPECT_TRUE(holds(*moving.scene.snapshot(), moving.positions(1)));
  }
  Positions fewer = moving.positions(2);
  fewer.pop_back();
  EXPECT_THROW(moving.scene.update_mesh<float>(moving.id, fewer, pool), InvalidArgument);
  EXPECT_TRUE(holds(*moving.show(2), moving.positions(2)));
}

TEST(MovedMesh, DoublePositionsAreRecentredForAnyThreadCount) {
  const auto far_away = [](int thread_count) {
    ThreadPool pool(thread_count);
    MovingScene moving(pool, 300);
    std::vector<Vec3d> positions;
    for (const Vec3f& p : moving.positions(3)) positions.push_back(to_double(p) + Vec3d{1e6, -1e6, 1e6});
    moving.scene.update_mesh<double>(moving.id, positions, pool);
    return moving.commit();
  };
  const SnapshotPointer one = far_away(1), three = far_away(3);
  EXPECT_TRUE(holds(*one, mesh_of(*three).positions));
  EXPECT_EQ(mesh_of(*one).centre, mesh_of(*three).centre);
  EXPECT_NEAR(mesh_of(*one).centre.x, 1e6, 1.0);
}

TEST(MovedMesh, ReplacedMeshesBeginAnew) {
  ThreadPool pool(2);
  MovingScene moving(pool);
  moving.show(0), moving.show(1);
  const Mesh other = bumpy_sheet(20);
  moving.scene.replace_mesh(moving.id, other);
  EXPECT_THROW(moving.scene.update_mesh<float>(moving.id, moving.positions(2), pool), InvalidArgument);
  moving.scene.update_mesh<float>(moving.id, other.positions, pool);
  EXPECT_TRUE(holds(*moving.commit(), other.positions));
}

class MovedMeshMemory : public testing::TestWithParam<bool> {};

TEST_P(MovedMeshMemory, RunsOutDuringAnUpdate) {
  ThreadPool pool(2);
  int failures = 0;
  for (long allowed = 0;; ++allowed) {
    MovingScene moving(pool, 10);
    moving.show(0), moving.show(1);
    const Positions positions = moving.positions(2), earlier = moving.positions(1);
    const SnapshotPointer before = moving.scene.snapshot();
    MemoryRunsOut fault(allowed, GetParam());
    bool failed = false;
    try {
      moving.scene.update_mesh<float>(moving.id, positions, pool);
    } catch (const std::bad_alloc&) {
      failed = true;
    }
    const bool ran_out = fault.end();
    failures += failed ? 1 : 0;
    if (failed) {
      EXPECT_TRUE(moving.scene.is_current());
      moving.scene.update_mesh<float>(moving.id, positions, pool);
    }
    ASSERT_TRUE(holds(*moving.commit(), positions)) << allowed;
    ASSERT_TRUE(holds(*before, earlier)) << allowed;
    if (!ran_out) break;
  }
  EXPECT_GE(failures, 2);
}

INSTANTIATE_TEST_SUITE_P(FailedAllocations, MovedMeshMemory, testing::Values(false, true),
                         [](const auto& test) { return test.param ? "ForGood" : "Once"; });

TEST(TriangleList, CopiesAreEditedApart) {
  Mesh mesh = bumpy_sheet(3);
  const Mesh copy = mesh;
  EXPECT_EQ(copy.triangles.data(), mesh.triangles.data());
  mesh.triangles.edit().push_back({0, 1, 2});
  EXPECT_EQ(mesh.triangles.size(), copy.triangles.size() + 1);
  EXPECT_NE(copy.triangles.data(), mesh.triangles.data());
  const TriangleList none;
  EXPECT_TRUE(none.empty());
  EXPECT_EQ(none.begin(), none.end());
}

// Instances by their ids, in any order: compared with a plain list of the expected ones.
TEST(MovedInstances, AreFoundByAnyListOfIds) {
  ThreadPool pool(2);
  std::mt19937 random(11);
  for (int round = 0; round < 60; ++round) {
    Scene scene;
    const std::int32_t mesh = scene.add_mesh(bumpy_sheet(1), {}, Usage::kStatic);
    std::vector<std::pair<std::int32_t, double>> expected;  // by id
    const auto add = [&](std::size_t count) {
      const std::int32_t first = scene.add_instances(std::vector<InstanceInput>(count, {mesh, Affine{}, 1, {}}));
      for (std::size_t i = 0; i < count; ++i) expected.emplace_back(first + static_cast<std::int32_t>(i), 0.0);
    };
    add(1 + random() % 40);
    for (int edit = 0; edit < 12; ++edit) {
      if (random() % 3 == 0 && expected.size() > 2) {
        const std::size_t row = random() % expected.size();
        scene.remove_instances(std::vector{expected[row].first, expected[row].first});
        expected.erase(expected.begin() + static_cast<std::ptrdiff_t>(row));
      }
      if (random() % 4 == 0) add(random() % 5);
      // A run of neighbours, or any ids, perhaps backwards, perhaps one twice.
      std::vector<std::size_t> rows;
      const std::size_t begin = random() % expected.size();
      const std::size_t count = 1 + random() % (expected.size() - begin);
      for (std::size_t i = 0; i < count; ++i) rows.push_back(begin + i);
      if (random() % 3 == 0) std::shuffle(rows.begin(), rows.end(), random);
      if (random() % 3 == 0) std::reverse(rows.begin(), rows.end());
      if (random() % 4 == 0) rows.push_back(rows.front());
      std::vector<std::int32_t> ids;
      std::vector<Affine> maps;
      for (const std::size_t row : rows) {
        const double x = static_cast<double>(random() % 1000);
        ids.push_back(expected[row].first), maps.push_back({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {x, 0, 0}});
        expected[row].second = x;
      }
      scene.set_transforms(ids, maps);
      ids.back() = expected.back().first + 1;  // no instance has this id yet
      for (Affine& map : maps) map.translation.x = -1;
      EXPECT_THROW(scene.set_transforms(ids, maps), InvalidArgument);
    }
    CancelToken cancel;
    scene.commit(pool, cancel);
    const SnapshotPointer snapshot = scene.snapshot();
    ASSERT_EQ(snapshot->instances.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      ASSERT_EQ(snapshot->instances[i].id, expected[i].first);
      ASSERT_EQ(snapshot->instances[i].object_to_world.translation.x, expected[i].second) << round;
    }
  }
}

}  // namespace
}  // namespace perfect_bvh::test
