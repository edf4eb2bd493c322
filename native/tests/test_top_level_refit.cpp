// The top level over instances that move: refitted or rebuilt, its hits are those of a newly built scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>

#include "core/errors.h"
#include "query/trace.h"
#include "scene/scene.h"
#include "tests/reference_trace.h"

namespace perfect_bvh::test {
namespace {

// Two triangles that cross: hits on their edges and corners are as likely as possible.
Mesh cross() {
  const std::vector<Vec3f> positions{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, -1, -1}, {0, -1, 1}};
  return make_mesh(positions, std::vector<Vec3<std::int32_t>>{{0, 1, 2}, {3, 4, 2}}, "test");
}

using Maps = std::vector<Affine>;

// Turned and sheared at random, at points of a grid with this `spacing`.
Maps grid_of(std::size_t count, double spacing, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> entry(-1.0, 1.0);
  const auto vector = [&] { return Vec3d{entry(random), entry(random), entry(random)}; };
  Maps maps;
  for (std::size_t i = 0; i < count; ++i) {
    const auto place = [&](std::size_t number) { return static_cast<double>(number) * spacing; };
    const Vec3d cell{place(i % 16), place(i / 16 % 16), place(i / 256)};
    maps.push_back({vector(), vector(), vector(), cell + vector() * (0.3 * spacing)});
  }
  return maps;
}

Maps times(Maps maps, double factor) {
  for (Affine& map : maps) map.translation = map.translation * factor;
  return maps;
}

std::vector<Ray> rays_through(const Maps& maps, std::size_t count) {
  std::mt19937 random(3);
  std::uniform_int_distribution<std::size_t> any(0, maps.size() - 1);
  std::normal_distribution<double> offset(0.0, 5.0);
  std::vector<Ray> rays(count);
  for (Ray& ray : rays) {
    const Vec3d target = maps[any(random)].translation;
    ray.origin = target + Vec3d{offset(random), offset(random), offset(random)};
    ray.direction = target - ray.origin;
  }
  return rays;
}

class Field {
 public:
  Field(const Maps& maps, int thread_count = 1) : pool_(thread_count) {
    const std::int32_t mesh = scene_.add_mesh(cross(), {}, Usage::kStatic);
    std::vector<InstanceInput> inputs;
    for (const Affine& map : maps) inputs.push_back({mesh, map, 0xFFFFFFFFu, std::nullopt});
    const std::int32_t first = scene_.add_instances(inputs);
    for (std::size_t i = 0; i < maps.size(); ++i) ids_.push_back(first + static_cast<std::int32_t>(i));
    commit();
  }

  TopLevelReport move(const Maps& maps) {
    scene_.set_transforms(ids_, maps);
    return commit();
  }
  TopLevelReport commit(std::optional<double> expected_rays = std::nullopt) {
    CancelToken cancel;
    CommitOptions options;
    options.expected_rays = expected_rays;
    return scene_.commit(pool_, cancel, options).top_level;
  }
  [[nodiscard]] Scene& scene() { return scene_; }
  [[nodiscard]] std::shared_ptr<const Snapshot> snapshot() const { return scene_.snapshot(); }
  [[nodiscard]] const std::vector<std::int32_t>& ids() const { return ids_; }

 private:
  ThreadPool pool_;
  Scene scene_;
  std::vector<std::int32_t> ids_;
};

std::vector<Hit> hits_of(const Snapshot& snapshot, const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  trace_closest(snapshot, rays, hits);
  return hits;
}

void expect_same_hits(const std::vector<Hit>& hits, const std::vector<Hit>& expected) {
  std::size_t found = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    ASSERT_EQ(hits[i].t, expected[i].t) << i;
    ASSERT_EQ(hits[i].instance_index, expected[i].instance_index) << i;
    ASSERT_EQ(hits[i].primitive_index, expected[i].primitive_index) << i;
    found += hits[i].found() ? 1 : 0;
  }
  EXPECT_GT(found, hits.size() / 8);
}

bool same_trees(const Snapshot& a, const Snapshot& b) {
  const auto same = [](const auto& x, const auto& y) {
    return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0;
  };
  return same(a.top_level.nodes, b.top_level.nodes) && a.top_level.scale == b.top_level.scale &&
         a.top_level.extent.reach == b.top_level.extent.reach;
}

TEST(TopLevelRefit, HitsAreThoseOfAFreshSceneAndOfEveryTriangle) {
  for (const std::size_t count : {1u, 2u, 9u, 2000u}) {
    Field moved(grid_of(count, 3.0, 1));
    for (unsigned step = 2; step < 8; ++step) {
      const Maps maps = grid_of(count, 3.0 + 0.01 * step, step);
      moved.move(maps);
      const auto rays = rays_through(maps, 2000);
      const auto hits = hits_of(*moved.snapshot(), rays);
      expect_same_hits(hits, hits_of(*Field(maps).snapshot(), rays));
      for (std::size_t i = 0; i < rays.size(); i += 40) {
        const Hit expected = reference_closest(*moved.snapshot(), rays[i], Cull::kNone);
        ASSERT_EQ(hits[i].t, expected.t) << i;
        ASSERT_EQ(hits[i].instance_index, expected.instance_index) << i;
      }
    }
  }
}

// Every instance coincides with another: in every tree the first one wins.
TEST(TopLevelRefit, BreaksTiesAsAFreshTree) {
  const Maps apart = grid_of(400, 3.0, 1);
  Maps together = apart;
  for (std::size_t i = 0; i < together.size(); ++i) together[i] = apart[i / 2 * 2];
  Field moved(apart);
  EXPECT_TRUE(moved.move(times(apart, 1.0001)).is_refitted);
  moved.move(together);
  const auto rays = rays_through(together, 2000);
  expect_same_hits(hits_of(*moved.snapshot(), rays), hits_of(*Field(together).snapshot(), rays));
}

TEST(TopLevelRefit, IsChosenWhereInstancesKeepTheirNeighbours) {
  const Maps maps = grid_of(4000, 3.0, 1);
  Field field(maps);
  const TopLevelReport report = field.move(times(maps, 1.01));
  EXPECT_TRUE(report.is_refitted) << report.reason;
  EXPECT_EQ(report.builder, "binned");
  EXPECT_EQ(report.build_milliseconds, 0.0);
  EXPECT_GT(report.refit_milliseconds, 0.0);
}

TEST(TopLevelRefit, IsRejectedWhereTheyAreShuffled) {
  Maps maps = grid_of(4000, 3.0, 1);
  Field field(maps);
  std::shuffle(maps.begin(), maps.end(), std::mt19937(5));
  const TopLevelReport report = field.move(maps);
  EXPECT_FALSE(report.is_refitted) << report.reason;
  EXPECT_GT(report.build_milliseconds, 0.0);
  EXPECT_TRUE(same_trees(*field.snapshot(), *Field(maps).snapshot()));
}

// The cost of a worse tree depends on the number of rays to come.
TEST(TopLevelRefit, IsDecidedByTheRaysToCome) {
  const Maps maps = grid_of(4000, 3.0, 1), next = grid_of(4000, 3.0, 2);
  for (const double rays : {0.0, 1e9}) {
    Field field(maps);
    field.scene().set_transforms(field.ids(), next);
    EXPECT_EQ(field.commit(rays).is_refitted, rays == 0.0) << rays;
  }
}

// A tree that was built while all instances were at one point has no information about which are near each other.
TEST(TopLevelRefit, IsRejectedAfterInstancesStoodAtOnePlace) {
  const Maps maps = grid_of(4000, 3.0, 1);
  Field field(times(maps, 0.0));
  double visits = 0;
  for (const double factor : {0.1, 0.3, 0.5, 0.7, 0.9, 1.0}) {
    field.move(times(maps, factor));
    visits = field.snapshot()->built_cost.node_visits;
  }
  EXPECT_LT(visits, 1.5 * Field(maps).snapshot()->built_cost.node_visits);
}

TEST(TopLevelRefit, MakesTheSameBytesForAnyThreadCount) {
  const Maps maps = grid_of(3000, 3.0, 1), next = times(maps, 1.005);
  Field alone(maps), others(maps, 3);
  EXPECT_TRUE(alone.move(next).is_refitted);
  EXPECT_TRUE(others.move(next).is_refitted);
  EXPECT_TRUE(same_trees(*alone.snapshot(), *others.snapshot()));
  EXPECT_TRUE(alone.move(maps).is_refitted);  // back at the start, the motion has left no trace
  EXPECT_TRUE(same_trees(*alone.snapshot(), *Field(maps).snapshot()));
}

// With this motion, box sizes are scaled by another power of two than when the tree was built.
TEST(TopLevelRefit, FollowsTheScaleOfTheScene) {
  const Maps maps = grid_of(300, 3.0, 1);
  Field field(maps);
  for (const double factor : {0x1p40, 0x1p-3, 1.0}) {
    Maps next = times(maps, factor);
    for (Affine& map : next) map.x = map.x * factor, map.y = map.y * factor, map.z = map.z * factor;
    field.move(next);
    auto rays = rays_through(maps, 500);
    for (Ray& ray : rays) ray.origin = ray.origin * factor, ray.direction = ray.direction * factor;
    expect_same_hits(hits_of(*field.snapshot(), rays), hits_of(*Field(next).snapshot(), rays));
  }
}

TEST(TopLevelRefit, GivesWayWhereInstancesComeAndGoOrAreFlattened) {
  Maps maps = grid_of(300, 3.0, 1);
  Field field(maps);
  maps[7].x = {0, 0, 0};  // no longer has an inverse
  field.move(maps);
  const auto rays = rays_through(maps, 1000);
  expect_same_hits(hits_of(*field.snapshot(), rays), hits_of(*Field(maps).snapshot(), rays));
  field.scene().remove_instances(std::vector<std::int32_t>{field.ids()[3]});
  const TopLevelReport report = field.commit();
  EXPECT_FALSE(report.is_refitted);
  EXPECT_EQ(report.reason, "instances were added or removed");
  field.scene().remove_instances(std::span(field.ids()).subspan(4));
  field.scene().remove_instances(std::span(field.ids()).first(3));
  field.commit();
  EXPECT_FALSE(hits_of(*field.snapshot(), rays)[0].found());
}

// The arrays of the last snapshot are reused only if no owner holds it.
TEST(TopLevelRefit, LeavesASnapshotThatIsHeldAlone) {
  const Maps maps = grid_of(2000, 3.0, 1);
  Field field(maps);
  const auto held = field.snapshot();
  const auto rays = rays_through(maps, 1000);
  const auto expected = hits_of(*held, rays);
  EXPECT_TRUE(field.move(times(maps, 1.002)).is_refitted);
  EXPECT_NE(field.snapshot(), held);
  expect_same_hits(hits_of(*held, rays), expected);
  const Snapshot* const place = field.snapshot().get();
  EXPECT_TRUE(field.move(times(maps, 1.004)).is_refitted);
  EXPECT_EQ(field.snapshot().get(), place);
  EXPECT_EQ(field.snapshot()->generation, 3u);
}

TEST(TopLevelRefit, IsTriedAgainAfterACancelledCommit) {
  const Maps maps = grid_of(2000, 3.0, 1), next = times(maps, 1.002);
  Field field(maps);
  const auto held = field.snapshot();
  field.scene().set_transforms(field.ids(), next);
  ThreadPool pool(2);
  CancelToken cancel;
  cancel.request_stop();
  EXPECT_THROW(static_cast<void>(field.scene().commit(pool, cancel)), Cancelled);
  EXPECT_THROW(static_cast<void>(field.snapshot()), StaleScene);
  EXPECT_EQ(held->generation, 1u);
  field.commit();
  EXPECT_EQ(field.snapshot()->generation, 2u);
  const auto rays = rays_through(next, 1000);
  expect_same_hits(hits_of(*field.snapshot(), rays), hits_of(*Field(next).snapshot(), rays));
}

}  // namespace
}  // namespace perfect_bvh::test
