// The nearest point of a curve's segment after a map, compared with many points of the hull; and queries, by every
// kernel, compared with testing every segment.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "math/distance.h"
#include "query/closest_points.h"
#include "tests/round_mesh_sets.h"
#include "tests/scenes_to_trace.h"

namespace perfect_bvh::test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

class RoundDistance : public testing::Test {
 protected:
  void TearDown() override { set_active_kernels(""); }

  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Vec3d any_direction() {
    std::normal_distribution<double> normal;
    return normalized(Vec3d{normal(random_), normal(random_), normal(random_)});
  }
  Vec3d any_point(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }

  // Out of line: see RoundSegment::ball.
  static __attribute__((noinline)) Vec3d narrowed(Vec3d v) { return to_double(to_float(v)); }

  Affine any_similarity() {
    const Vec3d x = any_direction(), y = normalized(cross(x, any_direction())), z = cross(x, y);
    const double scale = uniform(0.1, 10), turn = random_() % 2 == 0 ? 1 : -1;
    return {x * scale, y * scale, z * (scale * turn), any_point(3)};
  }
  // Sheared, and squeezed by up to 1000.
  Affine any_map() {
    Affine map{any_point(1), any_point(1), any_point(1), any_point(3)};
    if (random_() % 3 == 0) map.y = map.y * 1e-3;
    return map;
  }
  RoundEnds any_ends() {
    RoundEnds ends;
    const Vec3d from = any_point(1), to = from + any_point(random_() % 4 == 0 ? 0.05 : 1);
    for (int i = 0; i < 3; ++i) ends.first.centre[i] = from[i], ends.last.centre[i] = to[i];
    ends.first.radius = random_() % 5 == 0 ? 0 : uniform(0, 0.5);
    ends.last.radius = random_() % 5 == 0 ? ends.first.radius : uniform(0, 0.5);
    if (random_() % 6 == 0) ends.last = ends.first;
    return ends;
  }
  static RoundPlace place_of(const Affine& map) { return round_place(&map.x.x); }
  static NearestOnRound nearest(const Affine& map, const RoundEnds& ends, Vec3d query) {
    const Vec3d from = query - map.translation;
    return nearest_on_round(place_of(map), ends, &from.x);
  }
  static Vec3d vector_of(const double (&v)[3]) { return {v[0], v[1], v[2]}; }

  // Returns the distance of a point from the hull before the map, relative to the larger radius and the length.
  static double outside(const RoundEnds& ends, Vec3d point) {
    const Vec3d first = vector_of(ends.first.centre), axis = vector_of(ends.last.centre) - first;
    double least = kInfinity;
    double low = 0, high = 1;
    for (int i = 0; i < 100; ++i) {
      const double thirds[2] = {low + (high - low) / 3, high - (high - low) / 3};
      double at[2];
      for (int k = 0; k < 2; ++k) {
        at[k] = length(point - (first + axis * thirds[k])) -
                (ends.first.radius + thirds[k] * (ends.last.radius - ends.first.radius));
        least = std::min(least, at[k]);
      }
      (at[0] < at[1] ? high : low) = thirds[at[0] < at[1] ? 1 : 0];
    }
    return least;
  }

  // Checks that the found point is on the hull, and that the whole hull is behind the plane through it, at right angles
  // to the direction of the query. Then no point of the convex body is nearer. `slack`: the direction to a near point
  // of a squeezed body has fewer digits than its length.
  static void expect_nearest(const Affine& map, const RoundEnds& ends, Vec3d query, double slack = 1e-12) {
    const NearestOnRound found = nearest(map, ends, query);
    const Vec3d before = inverse(map).point(query);
    if (found.is_inside) {
      ASSERT_EQ(found.squared, 0.0);
      ASSERT_LT(outside(ends, before), 1e-9);
      return;
    }
    ASSERT_LT(outside(ends, vector_of(found.point)), 1e-12);
    const Vec3d away = query - map.point(vector_of(found.point));
    const double distance = length(away), size = 10;
    ASSERT_NEAR(std::sqrt(found.squared), distance, 1e-12 * size);
    if (distance < 1e-6) return;
    const Vec3d normal = away * (1 / distance), slope = map.transposed_vector(normal);
    double farthest = -kInfinity;  // of the hull, along the normal
    for (const RoundBall* const ball : {&ends.first, &ends.last}) {
      farthest = std::max(farthest, dot(normal, map.point(vector_of(ball->centre))) + ball->radius * length(slope));
    }
    ASSERT_LT(farthest - dot(normal, map.point(vector_of(found.point))), 1e-7 * distance + slack * size);
  }

  std::mt19937_64 random_{3};
};

TEST_F(RoundDistance, NearestAfterASimilarity) {
  for (int i = 0; i < 50000; ++i) {
    const Affine map = i % 3 == 0 ? Affine{} : any_similarity();
    ASSERT_TRUE(place_of(map).is_similar);
    expect_nearest(map, any_ends(), map.point(any_point(1.5)));
    if (HasFatalFailure()) FAIL() << i;
  }
}

TEST_F(RoundDistance, NearestAfterAnyMap) {
  for (int i = 0; i < 50000; ++i) {
    const Affine map = any_map();
    if (std::abs(map.determinant()) < 1e-2 * length(map.x) * length(map.y) * length(map.z)) continue;
    expect_nearest(map, any_ends(), map.point(any_point(1.5)), 1e-7);
    if (HasFatalFailure()) FAIL() << i;
  }
}

// Similarities rounded to float: they are hardly distinguishable from exact ones, and must not be treated as such.
TEST_F(RoundDistance, NearestAfterASimilarityInFloat) {
  for (int i = 0; i < 20000; ++i) {
    Affine map = any_similarity();
    for (Vec3d* const column : {&map.x, &map.y, &map.z}) *column = narrowed(*column);
    expect_nearest(map, any_ends(), map.point(any_point(1.5)));
    if (HasFatalFailure()) FAIL() << i;
  }
}

TEST_F(RoundDistance, QueriesMatchEverySegment) {
  Scene scene;
  const Mesh meshes[] = {fur(30, 6, 0.02f, 0.4f).curves(), cloud(60, 0.0f, 0.1f).points()};
  std::vector<InstanceInput> inputs;
  for (const Mesh& mesh : meshes) {
    const std::int32_t id = scene.add_mesh(mesh, BuildConfig{}, Usage::kStatic);
    inputs.push_back({id, Affine{}, ~0u, {}});
    for (int i = 0; i < 3; ++i) inputs.push_back({id, i == 0 ? any_map() : any_similarity(), ~0u, {}});
  }
  scene.add_instances(inputs);
  ThreadPool pool(1);
  CancelToken cancel;
  scene.commit(pool, cancel);
  const auto snapshot = scene.snapshot();
  std::vector<Vec3d> queries(1500);
  for (Vec3d& query : queries) query = any_point(4);
  const double farthest = kInfinity;
  const std::uint32_t mask = ~0u;
  const PointColumns columns{queries.size(), queries.data(), &farthest, &mask, 0, 0};
  std::vector<double> expected(queries.size(), kInfinity);
  for (std::size_t i = 0; i < queries.size(); ++i) {
    for (const Instance& instance : snapshot->instances) {
      const Mesh& mesh = instance.blas->mesh;
      const RoundList list{mesh.balls.data(), mesh.segments.data(), 1.0f};
      for (std::uint32_t k = 0; k < mesh.primitive_count(); ++k) {
        expected[i] = std::min(expected[i], nearest(instance.object_to_world, ends_of(list, k), queries[i]).squared);
      }
    }
  }
  for (const KernelTable* const kernels : available_kernels()) {
    set_active_kernels(kernels->name);
    std::vector<double> points(3 * queries.size()), distances(queries.size());
    std::vector<std::int32_t> instances(queries.size()), mesh_ids(queries.size()), primitives(queries.size());
    std::vector<float> uvs(2 * queries.size());
    compute_closest_points(
        *snapshot, columns,
        {points.data(), distances.data(), instances.data(), mesh_ids.data(), primitives.data(), uvs.data()}, pool, 0,
        cancel);
    for (std::size_t i = 0; i < queries.size(); ++i) {
      ASSERT_EQ(distances[i], std::sqrt(expected[i])) << kernels->name << " query " << i;
      const Vec3d point{points[3 * i], points[3 * i + 1], points[3 * i + 2]};
      ASSERT_NEAR(length(queries[i] - point), distances[i], 1e-9) << kernels->name << " query " << i;
    }
  }
}

}  // namespace
}  // namespace perfect_bvh::test
