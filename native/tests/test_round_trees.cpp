// Trees over curves and points: from every builder, refitted, split, rotated, and in a scene.
#include <gtest/gtest.h>

#include <algorithm>

#include "blas/world_box.h"
#include "builders/builder.h"
#include "core/errors.h"
#include "scene/scene.h"
#include "tests/calibrations.h"
#include "tests/round_mesh_sets.h"
#include "tests/same_bytes.h"
#include "tests/tree_faults.h"
#include "tests/wide_trees.h"
#include "update/mesh_shape.h"

namespace perfect_bvh {
namespace {

using namespace test;

BuildConfig config_of(BuilderKind kind) {
  BuildConfig config;
  config.builder = kind;
  if (kind == BuilderKind::kSpatial) config.duplication_budget = 3.0f;
  return config;
}

class RoundTrees : public testing::TestWithParam<BuilderKind> {};

TEST_P(RoundTrees, AreSound) {
  for (const NamedRound& input : round_meshes()) {
    ThreadPool pool(2), alone(1);
    CancelToken cancel;
    const BuildConfig config = config_of(GetParam());
    const Bvh2 tree = build_tree(input.mesh, config, pool, cancel);
    EXPECT_EQ(find_fault(tree, input.mesh.primitive_count()), "") << input.name;
    EXPECT_TRUE(same_bytes(tree, build_tree(input.mesh, config, alone, cancel))) << input.name;
    const WideBvh wide = collapse_mesh(tree, input.mesh, pool, cancel);
    EXPECT_EQ(find_wide_fault(wide, input.mesh, tree.refittable), "") << input.name;
    EXPECT_TRUE(same_bytes(wide, collapse_mesh(tree, input.mesh, alone, cancel)));
  }
}

// After any splits, each point of a primitive is in a leaf that holds the primitive.
TEST_P(RoundTrees, HoldEveryPoint) {
  std::mt19937 random(6);
  for (const NamedRound& input : round_meshes()) {
    ThreadPool pool(1);
    CancelToken cancel;
    const Bvh2 tree = build_tree(input.mesh, config_of(GetParam()), pool, cancel);
    std::vector<std::vector<Aabb>> boxes(input.mesh.primitive_count());
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
      const Bvh2Node& node = tree.nodes[i];
      for (std::uint32_t row = 0; i != 1 && row < node.count; ++row) {
        boxes[tree.prim_indices[node.first + row]].push_back(node.box());
      }
    }
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      for (int sample = 0; sample < 20; ++sample) {
        const Vec3d point = point_inside(input.mesh, i, random);
        ASSERT_TRUE(std::ranges::any_of(boxes[i], [&](const Aabb& box) { return holds(box, point); }))
            << input.name << ", primitive " << i;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Builders, RoundTrees,
                         testing::Values(BuilderKind::kMedian, BuilderKind::kSweep, BuilderKind::kBinned,
                                         BuilderKind::kFast, BuilderKind::kSpatial),
                         [](const auto& builder) { return std::string(builder_name(builder.param)); });

TEST(RoundWideTrees, AreSoundStraightFromTheCurve) {
  for (const NamedRound& input : round_meshes()) {
    ThreadPool pool(2), alone(1);
    CancelToken cancel;
    const WideBvh wide = build_fast_wide(input.mesh, pool, cancel);
    EXPECT_EQ(find_wide_fault(wide, input.mesh, true), "") << input.name;
    EXPECT_TRUE(same_bytes(wide, build_fast_wide(input.mesh, alone, cancel))) << input.name;
    expect_tight(wide, input.mesh, input.name);
  }
}

// Hair is split where it is slanted; the resulting tree is better.
TEST(RoundWideTrees, AreCutWhereThatPays) {
  ThreadPool pool(2);
  CancelToken cancel;
  const Mesh sticks = fur(20000, 1, 0.002f, 1.0f).curves();
  const auto cost = [&](BuilderKind kind) {
    const Bvh2 tree = build_tree(sticks, config_of(kind), pool, cancel);
    const WideBvh wide = collapse_mesh(tree, sticks, pool, cancel);
    const TraceWork work = measure_trace_work(wide, sticks, cancel);
    return kWideNodeCost * work.node_visits + kWideLeafCost * work.leaf_visits;
  };
  EXPECT_LT(cost(BuilderKind::kSpatial), 0.6 * cost(BuilderKind::kBinned));
  EXPECT_GT(measure_air(sticks, cancel), 10.0);
  EXPECT_LT(measure_air(cloud(1000, 0.01f, 0.05f).points(), cancel), 1e-3);
}

TEST(RoundWideTrees, TakeFewBytes) {
  ThreadPool pool(2);
  CancelToken cancel;
  const Mesh mesh = fur(4000, 8, 0.002f, 0.3f).curves();
  const Bvh2 tree = build_tree(mesh, config_of(BuilderKind::kBinned), pool, cancel);
  const std::size_t bytes = mesh.byte_count() + collapse_mesh(tree, mesh, pool, cancel).byte_count();
  EXPECT_LE(static_cast<double>(bytes) / static_cast<double>(mesh.primitive_count()), 64.0);
}

TEST(RoundRefit, FollowsEveryMotion) {
  for (const NamedRound& input : round_meshes()) {
    for (const bool is_fast : {false, true}) {
      ThreadPool pool(2);
      CancelToken cancel;
      const Bvh2 binary = build_tree(input.mesh, config_of(BuilderKind::kBinned), pool, cancel);
      const WideBvh tree =
          is_fast ? build_fast_wide(input.mesh, pool, cancel) : collapse_mesh(binary, input.mesh, pool, cancel);
      for (const Motion& motion : motions()) {
        Positions centres;
        for (const Ball& ball : input.mesh.balls) centres.push_back(ball.centre);
        motion.apply(centres);
        Mesh mesh = input.mesh;
        for (std::size_t i = 0; i < centres.size(); ++i) {
          mesh.balls[i] = {centres[i], mesh.balls[i].radius * (i % 3 == 0 ? 1.5f : 1.0f)};
        }
        const std::string name = input.name + ", " + motion.name;
        if (!(tree_extent(triangle_bounds(mesh), 1.0f).reach < 1e19f)) continue;  // a scene rejects those
        const WideBvh moved = refitted(tree, mesh, 2);
        EXPECT_EQ(find_wide_fault(moved, mesh, true), "") << name;
        expect_tight(moved, mesh, name);
        EXPECT_TRUE(same_bytes(moved, refitted(tree, mesh, 1))) << name;
      }
    }
  }
}

Affine random_map(std::mt19937& random) {
  std::uniform_real_distribution<double> entry(-2.0, 2.0);
  const auto vector = [&] { return Vec3d{entry(random), entry(random), entry(random)}; };
  return {vector(), vector(), vector(), vector()};
}

// A sphere reaches its radius times the length of the map's row beyond its centre.
Aabb world_box(const Mesh& mesh, const Affine& map) {
  Aabb box;
  for (const Ball& ball : mesh.balls) {
    const Vec3d centre = map.point(to_double(ball.centre));
    Vec3d reach{0, 0, 0};
    for (int axis = 0; axis < 3; ++axis) {
      reach[axis] = length(Vec3d{map.x[axis], map.y[axis], map.z[axis]}) * static_cast<double>(ball.radius);
    }
    box.grow({to_float(centre - reach), to_float(centre + reach)});
  }
  return box;
}

TEST(RoundBounds, AreCloseAroundTurnedInstances) {
  std::mt19937 random(8);
  ThreadPool pool(1);
  CancelToken cancel;
  for (const NamedRound& input : round_meshes()) {
    if (input.mesh.primitive_count() == 0 || input.name == "tiny" || input.name == "far away") continue;
    const Bvh2 tree = build_tree(input.mesh, config_of(BuilderKind::kBinned), pool, cancel);
    const WideBvh wide = collapse_mesh(tree, input.mesh, pool, cancel);
    const SupportTable support(wide, input.mesh);
    const Aabb box = tree.bounds();
    for (int round = 0; round < 50; ++round) {
      const Affine map = random_map(random);
      const Aabb exact = world_box(input.mesh, map), by_balls = transformed_bounds(input.mesh, box, map),
                 by_table = transformed_bounds(support, reach_of(box), map);
      ASSERT_TRUE(by_balls.contains(exact)) << input.name << ", " << round;
      ASSERT_TRUE(by_table.contains(exact)) << input.name << ", " << round;
      EXPECT_LT(half_area(by_balls), 1.01 * half_area(exact) + 1e-3) << input.name << ", " << round;
      EXPECT_LT(half_area(by_table), 1.15 * half_area(exact) + 1e-3) << input.name << ", " << round;
    }
  }
}

class RoundScene : public testing::Test {
 protected:
  CommitReport commit(const CommitOptions& options = {}) { return scene_.commit(pool_, cancel_, options); }
  std::int32_t add(Mesh mesh, Usage usage, const Affine& map = {}) {
    const std::int32_t mesh_id = scene_.add_mesh(std::move(mesh), {}, usage);
    const InstanceInput instance{mesh_id, map, ~0u, {}};
    static_cast<void>(scene_.add_instances({&instance, 1}));
    return mesh_id;
  }
  [[nodiscard]] const Blas& blas() const { return *scene_.snapshot()->blases[0]; }
  void expect_sound(const std::string& name) {
    EXPECT_EQ(find_wide_fault(blas().wide, blas().mesh, is_refittable(blas().wide)), "") << name;
  }

  ThreadPool pool_{2};
  CancelToken cancel_;
  Scene scene_;
};

TEST_F(RoundScene, RefitsWhatMovesAndSaysSo) {
  for (const Usage usage : {Usage::kDeforming, Usage::kChanging}) {
    RoundInput input = fur(300, 8, 0.01f, 0.3f);
    const std::int32_t mesh_id = scene_.add_mesh(input.curves(), {}, usage);
    const InstanceInput instance{mesh_id, Affine{}, ~0u, {}};
    static_cast<void>(scene_.add_instances({&instance, 1}));
    const CommitReport built = commit();
    EXPECT_EQ(built.meshes[0].triangle_count, 2400u);
    for (int frame = 0; frame < 5; ++frame) {
      for (Vec3f& centre : input.centres) centre.x += 0.02f * centre.z * centre.z;
      scene_.update_balls<float>(mesh_id, PrimitiveKind::kCurves, {input.centres, {}});
      const CommitReport report = commit();
      EXPECT_EQ(report.meshes[0].action, MeshAction::kRefitted) << report.meshes[0].reason;
      expect_sound("refitted");
    }
    input.radii.assign(input.radii.size(), 0.02f);  // now tips have a radius, and no segment is dropped
    scene_.update_balls<float>(mesh_id, PrimitiveKind::kCurves, input.balls());
    EXPECT_NE(commit().meshes[0].action, MeshAction::kBuilt);
    input.radii.assign(input.radii.size(), 0.0f);
    scene_.update_balls<float>(mesh_id, PrimitiveKind::kCurves, input.balls());
    const CommitReport nothing = commit();
    EXPECT_EQ(nothing.meshes[0].action, MeshAction::kRebuilt);
    EXPECT_EQ(nothing.meshes[0].triangle_count, 0u);
  }
}

TEST_F(RoundScene, FollowsEachPolicyThroughViolentMotion) {
  for (const Policy policy :
       {Policy::kGoverned, Policy::kRefit, Policy::kRotate, Policy::kRebuildParts, Policy::kRebuild}) {
    RoundInput input = fur(300, 8, 0.01f, 0.3f);
    const std::int32_t mesh_id = scene_.add_mesh(input.curves(), {}, Usage::kDeforming);
    const InstanceInput instance{mesh_id, Affine{}, ~0u, {}};
    static_cast<void>(scene_.add_instances({&instance, 1}));
    const CommitOptions options = on_machine(1e6, policy);
    static_cast<void>(commit(options));
    for (const Motion& motion : motions()) {
      Positions centres(input.centres.begin(), input.centres.end());
      motion.apply(centres);
      scene_.update_balls<float>(mesh_id, PrimitiveKind::kCurves, {centres, {}});
      const CommitReport report = commit(options);
      for (const auto& held : scene_.snapshot()->blases) {
        EXPECT_EQ(find_wide_fault(held->wide, held->mesh, is_refittable(held->wide)), "")
            << motion.name << ", " << report.meshes[0].reason;
      }
    }
  }
}

TEST_F(RoundScene, IsCutWhereManyRaysRepayIt) {
  add(fur(3000, 1, 0.002f, 2.0f).curves(), Usage::kStatic);
  EXPECT_EQ(commit(on_machine(1e9)).meshes[0].builder, "spatial");
  EXPECT_FALSE(is_refittable(blas().wide));
  expect_sound("cut");
}

TEST_F(RoundScene, ShowsNothingOfWhatIsFlattened) {
  add(cloud(100, 0.1f, 0.2f).points(), Usage::kStatic, {{1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {0, 0, 0}});
  EXPECT_EQ(commit().baked_count, 1u);
  const Instance& instance = scene_.snapshot()->instances[0];
  EXPECT_TRUE(instance.baked);
  EXPECT_EQ(instance.blas->mesh.primitive_count(), 0u);
  EXPECT_TRUE(scene_.snapshot()->top_level.is_empty);
}

TEST_F(RoundScene, KeepsKindsApart) {
  const std::int32_t points = add(cloud(10, 0.1f, 0.2f).points(), Usage::kStatic);
  const std::vector<Vec3f> positions(10);
  const auto complaint = [](const auto& call) {
    try {
      call();
    } catch (const InvalidArgument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(complaint([&] { scene_.update_mesh<float>(points, positions); }),
            "update_mesh: mesh 0 must have triangles, but has points; update_points and replace_points are for those");
  EXPECT_EQ(complaint([&] { scene_.update_balls<float>(points, PrimitiveKind::kCurves, {positions, {}}); }),
            "update_curves: mesh 0 must have curves, but has points; update_points and replace_points are for those");
  EXPECT_EQ(complaint([&] { scene_.replace_mesh(points, Mesh{}); }),
            "replace_mesh: mesh 0 must have triangles, but has points; update_points and replace_points are for those");
}

}  // namespace
}  // namespace perfect_bvh
