// Refits of the wide tree: sound, tight and correct after any motion, the same bytes for any number of threads.
#include <gtest/gtest.h>

#include "blas/build_tree.h"
#include "core/errors.h"
#include "query/trace.h"
#include "scene/scene.h"
#include "tests/mesh_sets.h"
#include "tests/motions.h"
#include "tests/reference_trace.h"
#include "tests/same_bytes.h"
#include "tests/thread_counts.h"
#include "tests/tree_faults.h"
#include "tests/wide_trees.h"
#include "wide/wide_refit.h"

namespace perfect_bvh::test {
namespace {

class WideRefit : public testing::TestWithParam<Way> {};
INSTANTIATE_TEST_SUITE_P(Ways, WideRefit, testing::ValuesIn(ways()), [](const auto& test) { return test.param.name; });

TEST_P(WideRefit, GivesSoundTightTreesAfterAnyMotion) {
  for (const NamedMesh& input : hard_meshes()) {
    const WideBvh tree = build(input.mesh, GetParam());
    if (!is_refittable(tree)) continue;
    for (const Motion& motion : motions()) {
      const std::string name = input.name + ", " + motion.name;
      const Mesh mesh = moved(input.mesh, motion);
      const WideBvh after = refitted(tree, mesh);
      EXPECT_EQ(find_wide_fault(after, mesh, true), "") << name;
      expect_tight(after, mesh, name);
      // There and back, with any scale at the far end.
      EXPECT_TRUE(same_bytes(refitted(after, input.mesh), refitted(tree, input.mesh))) << name;
    }
  }
}

TEST_P(WideRefit, OfWhatDidNotMoveChangesNoByte) {
  for (const Mesh& mesh : {bumpy_sheet(60), triangle_soup(3000, 0.05f), scaled(bumpy_sheet(20), 1e15f)}) {
    const WideBvh tree = build(mesh, GetParam()), after = refitted(tree, mesh);
    EXPECT_TRUE(same_bytes(after, refitted(after, mesh)));
    // These builders' leaves were halved after their binary tree was built, and kept their boxes.
    const BuilderKind builder = GetParam().config.builder;
    if (builder != BuilderKind::kMedian && builder != BuilderKind::kFast) {
      EXPECT_TRUE(same_bytes(tree, after));
    }
  }
}

TEST_P(WideRefit, GivesTheSameBytesForAnyThreadCountAndWhateverWasInTheMemory) {
  for (const Mesh& still : {bumpy_sheet(200), triangle_soup(30000, 0.02f)}) {
    const WideBvh tree = build(still, GetParam());
    const Mesh mesh = moved(still, motions()[1]);
    const WideBvh alone = refitted(tree, mesh);
    for (const int thread_count : thread_counts()) EXPECT_TRUE(same_bytes(alone, refitted(tree, mesh, thread_count)));
    ThreadPool pool(2);
    CancelToken cancel;
    WideBvh reused = refitted(tree, moved(still, motions()[2]));
    const WideCosts costs = refit_wide(tree, plan_of(tree, mesh), mesh, reused, true, pool, cancel);
    EXPECT_TRUE(same_bytes(alone, reused));
    WideBvh foreign = build(bumpy_sheet(17), GetParam());
    static_cast<void>(refit_wide(tree, plan_of(tree, mesh), mesh, foreign, false, pool, cancel));
    EXPECT_TRUE(same_bytes(alone, foreign));
    EXPECT_EQ(costs.nodes, measure_wide_costs(alone, pool, cancel).nodes);
  }
}

// Through the scene, with any decision it makes: the hits are those of testing every triangle, and bit for bit those of
// a scene that was built in this state.
TEST_P(WideRefit, GivesTheHitsOfAFreshTree) {
  ThreadPool pool(2);
  CancelToken cancel;
  for (const NamedMesh& input : hard_meshes()) {
    if (input.mesh.primitive_count() > 2500) continue;
    Scene scene;
    const std::int32_t mesh_id = scene.add_mesh(Mesh(input.mesh), GetParam().config, GetParam().usage);
    const InstanceInput instance{mesh_id, Affine{}, ~0u, {}};
    static_cast<void>(scene.add_instances({&instance, 1}));
    static_cast<void>(scene.commit(pool, cancel));
    for (const Motion& motion : motions()) {
      const Mesh mesh = moved(input.mesh, motion);
      if (!(tree_extent(triangle_bounds(mesh), 1.0f).reach < 1e18f)) continue;  // a scene rejects those
      scene.update_mesh<float>(mesh_id, mesh.positions);
      const CommitReport report = scene.commit(pool, cancel);
      const std::string name = input.name + ", " + motion.name + ", " + report.meshes[0].reason;
      Scene fresh;
      const InstanceInput fresh_instance{fresh.add_mesh(Mesh(mesh), {}, Usage::kStatic), Affine{}, ~0u, {}};
      static_cast<void>(fresh.add_instances({&fresh_instance, 1}));
      static_cast<void>(fresh.commit(pool, cancel));
      const std::vector<Ray> rays = rays_at(mesh, 60);
      std::vector<Hit> hits(rays.size()), fresh_hits(rays.size());
      trace_closest(*scene.snapshot(), rays, hits);
      trace_closest(*fresh.snapshot(), rays, fresh_hits);
      EXPECT_EQ(std::memcmp(hits.data(), fresh_hits.data(), hits.size() * sizeof(Hit)), 0) << name;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        const Hit expected = reference_closest(*scene.snapshot(), rays[i], Cull::kNone);
        ASSERT_EQ(hits[i].primitive_index, expected.primitive_index) << name << ", ray " << i;
        ASSERT_EQ(hits[i].t, expected.t) << name << ", ray " << i;
      }
    }
  }
}

TEST_P(WideRefit, HoldsOverAHundredFrames) {
  ThreadPool pool(2);
  CancelToken cancel;
  const Mesh still = bumpy_sheet(40);
  Scene scene;
  const std::int32_t mesh_id = scene.add_mesh(Mesh(still), GetParam().config, GetParam().usage);
  static_cast<void>(scene.commit(pool, cancel));
  std::size_t refit_count = 0;
  for (int frame = 1; frame <= 100; ++frame) {
    Mesh mesh = still;
    twist(mesh.positions, 0.02f * static_cast<float>(frame));
    scene.update_mesh<float>(mesh_id, mesh.positions);
    refit_count += scene.commit(pool, cancel).meshes[0].action != MeshAction::kRebuilt;
    ASSERT_EQ(find_wide_fault(scene.snapshot()->blases[0]->wide, mesh, true), "") << frame;
  }
  EXPECT_GT(refit_count, 90u);
}

TEST(WideRefit, NeverTouchesASnapshot) {
  ThreadPool pool(1);
  CancelToken cancel;
  const Mesh still = bumpy_sheet(30);
  Scene scene;
  const std::int32_t mesh_id = scene.add_mesh(Mesh(still), {}, Usage::kDeforming);
  std::vector<std::shared_ptr<const Snapshot>> snapshots;
  std::vector<Mesh> meshes;
  for (int frame = 0; frame < 8; ++frame) {
    Mesh mesh = still;
    twist(mesh.positions, 0.1f * static_cast<float>(frame));
    if (frame > 0) scene.update_mesh<float>(mesh_id, mesh.positions);
    static_cast<void>(scene.commit(pool, cancel));
    if (frame % 3 != 1) snapshots.push_back(scene.snapshot()), meshes.push_back(mesh);
  }
  for (std::size_t i = 0; i < snapshots.size(); ++i) {
    EXPECT_EQ(find_wide_fault(snapshots[i]->blases[0]->wide, meshes[i], true), "") << i;
  }
}

TEST(WideRefit, ReusesMemoryThatIsNoLongerRead) {
  ThreadPool pool(1);
  CancelToken cancel;
  const Mesh mesh = bumpy_sheet(30);
  Scene scene;
  const std::int32_t mesh_id = scene.add_mesh(Mesh(mesh), {}, Usage::kDeforming);
  static_cast<void>(scene.commit(pool, cancel));
  std::vector<const WideNode*> places;
  for (int frame = 0; frame < 6; ++frame) {
    scene.update_mesh<float>(mesh_id, mesh.positions);
    static_cast<void>(scene.commit(pool, cancel));
    places.push_back(scene.snapshot()->blases[0]->wide.nodes.data());
  }
  EXPECT_EQ(places[4], places[2]);
  EXPECT_EQ(places[5], places[3]);
  EXPECT_NE(places[5], places[4]);
}

TEST(WideRefit, RefusesTreesWithSpatialSplits) {
  ThreadPool pool(1);
  CancelToken cancel;
  BuildConfig config;
  config.builder = BuilderKind::kSpatial;
  const Mesh mesh = sticks(300);
  const WideBvh tree = collapse_mesh(build_tree(mesh, config, pool, cancel), mesh, pool, cancel);
  WideBvh result;
  EXPECT_FALSE(is_refittable(tree));
  EXPECT_THROW(static_cast<void>(refit_wide(tree, {}, mesh, result, false, pool, cancel)), InvalidArgument);
}

TEST(WideRefit, CancelledLeavesTheOldTree) {
  ThreadPool pool(2);
  CancelToken cancel;
  const Mesh still = bumpy_sheet(100);
  Scene scene;
  const std::int32_t mesh_id = scene.add_mesh(Mesh(still), {}, Usage::kDeforming);
  static_cast<void>(scene.commit(pool, cancel));
  const auto before = scene.snapshot();
  const Mesh mesh = moved(still, motions()[1]);
  scene.update_mesh<float>(mesh_id, mesh.positions);
  CancelToken stopped;
  stopped.request_stop();
  EXPECT_THROW(static_cast<void>(scene.commit(pool, stopped)), Cancelled);
  EXPECT_EQ(find_wide_fault(before->blases[0]->wide, still, true), "");
  static_cast<void>(scene.commit(pool, cancel));
  EXPECT_EQ(find_wide_fault(scene.snapshot()->blases[0]->wide, mesh, true), "");
}

}  // namespace
}  // namespace perfect_bvh::test
