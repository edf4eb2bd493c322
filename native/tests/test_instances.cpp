// Placing instances and joining them into the top level: bounds, extreme sizes, the report, and stopping half-way.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <thread>

#include "blas/build_tree.h"
#include "core/errors.h"
#include "query/trace.h"
#include "query/tree_boxes.h"
#include "scene/scene.h"
#include "tests/reference_trace.h"
#include "tests/thread_counts.h"
#include "tlas/instance.h"
#include "wide/collapse.h"

namespace perfect_bvh::test {
namespace {

// Thin triangles at random in a box of the given reach.
Mesh soup(std::size_t count, unsigned seed, double reach = 1.0) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-1.0, 1.0), size(-0.2, 0.2);
  std::vector<Vec3f> positions;
  std::vector<Vec3<std::int32_t>> triangles;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d corner{place(random), 0.5 * place(random), 0.25 * place(random)};
    for (int k = 0; k < 3; ++k) {
      const Vec3d step{size(random), size(random), size(random)};
      positions.push_back(to_float((corner + step) * reach));
    }
    const auto first = static_cast<std::int32_t>(3 * i);
    triangles.push_back({first, first + 1, first + 2});
  }
  return make_mesh(positions, triangles, "test");
}

// Sheared, turned, sometimes mirrored.
Affine random_map(std::mt19937& random, double size, double spread) {
  std::uniform_real_distribution<double> entry(-1.0, 1.0);
  const auto vector = [&](double scale) { return Vec3d{entry(random), entry(random), entry(random)} * scale; };
  return {vector(size), vector(size), vector(size), vector(spread)};
}

std::vector<InstanceInput> random_instances(std::int32_t mesh, std::size_t count, double size, double spread) {
  std::mt19937 random(4);
  std::vector<InstanceInput> inputs;
  for (std::size_t i = 0; i < count; ++i) {
    inputs.push_back({mesh, random_map(random, size, spread), 0xFFFFFFFFu, std::nullopt});
  }
  return inputs;
}

std::shared_ptr<const Snapshot> commit(Scene& scene, int thread_count = 1, CommitReport* report = nullptr) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  const CommitReport made = scene.commit(pool, cancel);
  if (report != nullptr) *report = made;
  return scene.snapshot();
}

TreeStatistics top_level_of(const Snapshot& snapshot) {
  ThreadPool pool(1);
  CancelToken cancel;
  return measure(snapshot, {}, pool, cancel).top_level;
}

std::vector<Ray> random_rays(std::size_t count, double scale) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> place(-1.5, 1.5);
  std::vector<Ray> rays(count);
  for (Ray& ray : rays) {
    ray.origin = Vec3d{place(random), place(random), place(random)} * scale;
    ray.direction = Vec3d{place(random), place(random), place(random)} * (0.7 * scale) - ray.origin;
  }
  return rays;
}

Aabb exact_bounds(const Mesh& mesh, const Affine& map) {
  Aabb box;
  for (const Vec3f& position : mesh.positions) {
    const Vec3d point = map.point(to_double(position));
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = std::min(box.lower[axis], round_down(point[axis]));
      box.upper[axis] = std::max(box.upper[axis], round_up(point[axis]));
    }
  }
  return box;
}

double sum_of_side_logs(const Aabb& box) {
  double sum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    sum += std::log2(static_cast<double>(box.upper[axis]) - static_cast<double>(box.lower[axis]));
  }
  return sum;
}

// Bounds from the box around the mesh, tighter ones from the table, and the tightest from the vertices.
TEST(InstanceBounds, HoldEveryVertexAndAreClose) {
  ThreadPool pool(1);
  CancelToken cancel;
  std::mt19937 random(1);
  for (const double reach : {1e-18, 1e-6, 1.0, 3e5, 1e17}) {
    const Mesh mesh = soup(300, 2, reach);
    const Bvh2 tree = build_tree(mesh, {}, pool, cancel);
    const SupportTable support(collapse_mesh(tree, mesh, pool, cancel), mesh);
    double exact = 0, by_root = 0, by_support = 0, by_vertices = 0;
    constexpr int kRounds = 200;
    for (int round = 0; round < kRounds; ++round) {
      const Affine map = random_map(random, std::exp2(round % 40 - 20), reach);
      const Aabb least = exact_bounds(mesh, map), turned = transformed_bounds(tree.bounds(), map);
      const Aabb supported = transformed_bounds(support, reach_of(tree.bounds()), map);
      const Aabb from_vertices = transformed_bounds(mesh, tree.bounds(), map);
      ASSERT_TRUE(turned.contains(least)) << reach;
      ASSERT_TRUE(supported.contains(least)) << reach;
      ASSERT_TRUE(from_vertices.contains(least)) << reach;
      exact += sum_of_side_logs(least), by_root += sum_of_side_logs(turned);
      by_support += sum_of_side_logs(supported), by_vertices += sum_of_side_logs(from_vertices);
    }
    const double percent = std::log2(1.01) * 3 * kRounds;
    EXPECT_LT(by_support, exact + 2 * percent) << reach;
    EXPECT_LT(by_vertices, exact + percent) << reach;
    EXPECT_GT(by_root, exact + 15 * percent) << reach;
  }
}

// At the sampled directions: bounds of a mesh that is turned by right angles, mirrored or flattened equal those of its
// box.
TEST(InstanceBounds, OfTheTableAreExactAlongTheAxes) {
  ThreadPool pool(1);
  CancelToken cancel;
  for (const std::size_t count : {1u, 2u, 300u}) {
    const Mesh mesh = soup(count, 7);
    const Bvh2 tree = build_tree(mesh, {}, pool, cancel);
    const SupportTable support(collapse_mesh(tree, mesh, pool, cancel), mesh);
    const Aabb box = tree.bounds();
    for (const double size : {1.0, -1.0, 1e-30, 1e18}) {
      for (int axis = 0; axis < 3; ++axis) {
        Vec3d row{0, 0, 0};
        row[axis] = size;
        const auto range = support.along(row);
        const double ends[2] = {size * static_cast<double>(box.lower[axis]),
                                size * static_cast<double>(box.upper[axis])};
        EXPECT_EQ(range.least, std::min(ends[0], ends[1]));
        EXPECT_EQ(range.greatest, std::max(ends[0], ends[1]));
      }
    }
    EXPECT_EQ(support.along({0, 0, 0}).least, 0.0);
    EXPECT_EQ(support.along({0, 0, 0}).greatest, 0.0);
  }
}

// If a map mirrors, scales and turns by right angles, the box around the mesh gives bounds as tight as any.
TEST(InstanceBounds, LookCloserOnlyWhereTheMeshIsTurned) {
  ThreadPool pool(1);
  CancelToken cancel;
  Blas blas(std::make_shared<const Mesh>(soup(300, 7)));
  const Bvh2 tree = build_tree(blas.mesh, {}, pool, cancel);
  blas.box = tree.bounds();
  blas.wide = collapse_mesh(tree, blas.mesh, pool, cancel);
  const Affine kept{{0, -2, 0}, {0, 0, 3}, {1, 0, 0}, {5, 6, 7}}, turned{{1, -2, 0}, {2, 1, 0}, {0, 0, 1}, {5, 6, 7}};
  ASSERT_TRUE(keeps_axes(kept));
  ASSERT_FALSE(keeps_axes(turned));
  Instance instance;
  for (const Affine& map : {kept, turned}) {
    const Aabb by_box = transformed_bounds(blas.box, map);
    for (const bool has_table : {false, true}) {
      Placing placing;
      ASSERT_TRUE(place_instance(instance, placing, blas, map, has_table));
      ASSERT_TRUE(by_box.contains(placing.world_bounds));
      EXPECT_EQ(placing.world_bounds.contains(by_box), keeps_axes(map)) << has_table;
    }
  }
}

// Far vertices of no triangle, and rows too short for float, do not make bounds looser than those from the box.
TEST(InstanceBounds, OfVerticesAreNeverLooserThanTheBox) {
  std::mt19937 random(6);
  Mesh mesh = soup(300, 5);
  Aabb box;
  for (std::size_t i = 0; i < mesh.primitive_count(); ++i) box.grow(mesh.primitive_box(i));
  mesh.positions.push_back({1e6f, -1e6f, 1e6f});
  for (int round = 0; round < 100; ++round) {
    Affine map = random_map(random, std::exp2(round % 40 - 20), 1.0);
    if (round % 3 == 0) map.x = map.x * 1e-40, map.y = map.y * 1e-40, map.z = map.z * 1e-40;
    ASSERT_TRUE(transformed_bounds(box, map).contains(transformed_bounds(mesh, box, map))) << round;
  }
  EXPECT_TRUE(transformed_bounds(mesh, Aabb{}, Affine{}).is_empty());
}

TEST(InstanceBounds, OfThreeRowsAtOnceAreThoseOfEach) {
  ThreadPool pool(1);
  CancelToken cancel;
  std::mt19937 random(3);
  const Mesh mesh = soup(300, 7);
  const Bvh2 tree = build_tree(mesh, {}, pool, cancel);
  const SupportTable support(collapse_mesh(tree, mesh, pool, cancel), mesh);
  for (int round = 0; round < 3000; ++round) {
    Affine map = random_map(random, std::exp2(round % 180 - 90), 1.0);
    if (round % 7 == 0) map.x = {0, 0, 0};  // rows along the faces' edges
    if (round % 11 == 0) map.y = {0, 0, 0}, map.z = {0, 0, 0};
    RowRange ranges[3];
    if (round % 77 == 0) {
      ASSERT_FALSE(support.along_ordinary_rows(map, ranges));
      continue;
    }
    ASSERT_TRUE(support.along_ordinary_rows(map, ranges));
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d row{map.x[axis], map.y[axis], map.z[axis]};
      const RowRange expected = support.along(row);
      const double slack = 1e-5 * (std::abs(row.x) + std::abs(row.y) + std::abs(row.z));
      ASSERT_NEAR(ranges[axis].least, expected.least, slack) << round;
      ASSERT_NEAR(ranges[axis].greatest, expected.greatest, slack) << round;
    }
  }
  for (const double size : {1e-35, 1e35}) {
    RowRange ranges[3];
    EXPECT_FALSE(support.along_ordinary_rows({{1, 0, 0}, {0, size, 0}, {0, 0, 1}, {0, 0, 0}}, ranges));
  }
}

// Products of positions and transforms reach 1e36; surface areas would overflow.
TEST(Instances, MeetTheSameAtAnySize) {
  struct Size {
    double mesh, map;
  };
  std::vector<Hit> expected;
  std::vector<RayCounts> expected_counts;
  for (const Size size : {Size{1, 1}, Size{0x1p59, 0x1p59}, Size{0x1p20, 0x1p59}, Size{0x1p59, 1}, Size{0x1p-50, 1},
                          Size{0x1p-50, 0x1p-10}}) {
    Scene scene;
    const std::int32_t mesh = scene.add_mesh(soup(40, 3, size.mesh), {}, Usage::kStatic);
    auto inputs = random_instances(mesh, 200, 0.3 * size.map, 0.0);
    scene.add_instances(inputs);
    const auto snapshot = commit(scene);
    const auto rays = random_rays(500, size.mesh * size.map * 0.3);
    std::vector<Hit> hits(rays.size());
    std::vector<RayCounts> counts(rays.size());
    trace_closest(*snapshot, rays, hits, Cull::kNone, counts);
    if (expected.empty()) expected = hits, expected_counts = counts;
    std::size_t found = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(hits[i].t, reference_closest(*snapshot, rays[i], Cull::kNone).t);
      ASSERT_EQ(hits[i].t, expected[i].t) << size.mesh << " " << size.map;
      ASSERT_EQ(hits[i].instance_index, expected[i].instance_index);
      ASSERT_EQ(hits[i].primitive_index, expected[i].primitive_index);
      ASSERT_EQ(counts[i].nodes_visited, expected_counts[i].nodes_visited) << size.mesh << " " << size.map;
      found += hits[i].found() ? 1 : 0;
    }
    EXPECT_GT(found, rays.size() / 4);
    EXPECT_TRUE(std::isfinite(top_level_of(*snapshot).sah));
  }
}

TEST(Instances, HaveTheSameRowsForAnyThreadCount) {
  Scene scene;
  const std::int32_t mesh = scene.add_mesh(soup(40, 3), {}, Usage::kStatic);
  auto inputs = random_instances(mesh, 5000, 0.1, 3.0);
  for (std::size_t i = 0; i < inputs.size(); i += 700) inputs[i].object_to_world.x = {0, 0, 0};  // these are baked
  scene.add_instances(inputs);
  const auto alone = commit(scene);
  for (const int thread_count : thread_counts()) {
    scene.set_masks(std::vector<std::int32_t>{0}, std::vector<std::uint32_t>{0xFFFFFFFFu});  // else the tree is kept
    const auto other = commit(scene, thread_count);
    ASSERT_EQ(alone->top_level.nodes.size(), other->top_level.nodes.size());
    EXPECT_EQ(std::memcmp(alone->top_level.nodes.data(), other->top_level.nodes.data(),
                          alone->top_level.nodes.size() * sizeof(WideNode)),
              0);
    ASSERT_EQ(alone->blases.size(), other->blases.size());
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const InstanceView &a = alone->instance_views[i], &b = other->instance_views[i];
      ASSERT_EQ(std::memcmp(a.world_to_local, b.world_to_local, sizeof(a.world_to_local)), 0) << i;
      ASSERT_EQ(alone->instances[i].baked, other->instances[i].baked) << i;
    }
  }
}

TEST(Instances, AreBakedOnlyWhileTheyAreFlat) {
  Scene scene;
  const std::int32_t mesh = scene.add_mesh(soup(10, 3), {}, Usage::kStatic);
  auto inputs = random_instances(mesh, 3, 0.1, 3.0);
  const std::vector<Affine> upright{inputs[1].object_to_world};
  inputs[1].object_to_world.x = {0, 0, 0};
  const std::vector<std::int32_t> ids{scene.add_instances(inputs) + 1};
  ASSERT_TRUE(commit(scene)->instances[1].baked);
  scene.set_transforms(ids, upright);
  EXPECT_FALSE(commit(scene)->instances[1].baked);  // no one held the last snapshot: its rows are used again
}

TEST(TopLevelReport, NamesWhatMadeTheTree) {
  CommitReport report;
  Scene scene;
  commit(scene, 1, &report);
  EXPECT_EQ(report.top_level.builder, "");
  const std::int32_t mesh = scene.add_mesh(soup(10, 3), {}, Usage::kStatic);
  scene.add_instances(random_instances(mesh, 2, 0.1, 3.0));  // there is only one tree over two
  auto snapshot = commit(scene, 1, &report);
  EXPECT_EQ(report.top_level.builder, "binned");
  EXPECT_EQ(top_level_of(*snapshot).builder, "binned");
  EXPECT_GT(report.top_level.placing_milliseconds, 0.0);
  EXPECT_GT(report.top_level.build_milliseconds, 0.0);
  EXPECT_GT(report.top_level.clustering_milliseconds, 0.0);
  EXPECT_GT(report.top_level.collapse_milliseconds, 0.0);
  // A ground under pebbles; planes through centroids cannot separate them.
  const std::vector<Vec3f> corners{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}};
  const std::int32_t flat =
      scene.add_mesh(make_mesh(corners, std::vector<Vec3<std::int32_t>>{{0, 1, 2}}, "test"), {}, Usage::kStatic);
  auto inputs = random_instances(mesh, 500, 0.01, 1.0);
  Affine ground;
  ground.x = {1000, 0, 0}, ground.y = {0, 1000, 0}, ground.z = {0, 0, 1};
  inputs.push_back({flat, ground, 1, std::nullopt});
  scene.add_instances(inputs);
  snapshot = commit(scene, 1, &report);
  EXPECT_EQ(report.top_level.builder, "agglomerative");
  EXPECT_EQ(top_level_of(*snapshot).builder, "agglomerative");
  commit(scene, 1, &report);  // nothing was edited
  EXPECT_EQ(report.top_level.builder, "agglomerative");
  EXPECT_EQ(report.top_level.placing_milliseconds, 0.0);
}

// As with Ctrl-C: the callback of a commit that only places and joins instances is called.
TEST(TopLevelCommit, StopsWhenAsked) {
  Scene scene;
  const std::int32_t mesh = scene.add_mesh(soup(10, 3), {}, Usage::kStatic);
  commit(scene);
  scene.add_instances(random_instances(mesh, 5000, 0.1, 3.0));
  for (const int thread_count : {1, 2}) {
    ThreadPool pool(thread_count);
    int calls = 0;
    CancelToken cancel([&](float) {
      ++calls;
      return false;
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(60));  // long enough that the callback is due
    EXPECT_THROW(scene.commit(pool, cancel), Cancelled);
    EXPECT_EQ(calls, 1);
    EXPECT_FALSE(scene.is_current());
  }
  EXPECT_EQ(commit(scene)->instances.size(), 5000u);
}

}  // namespace
}  // namespace perfect_bvh::test
