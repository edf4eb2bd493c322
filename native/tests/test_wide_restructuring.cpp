// Rotations and rebuilt parts: sound, tight and never worse, correct to the bit, after any motion.
#include <gtest/gtest.h>

#include <cmath>

#include "query/trace.h"
#include "scene/scene.h"
#include "tests/mesh_sets.h"
#include "tests/reference_trace.h"
#include "tests/same_bytes.h"
#include "tests/thread_counts.h"
#include "tests/tree_faults.h"
#include "tests/wide_trees.h"
#include "tlas/instance.h"
#include "wide/wide_rebuild.h"

namespace perfect_bvh::test {
namespace {

// A tree after a motion, with its cost now and when it was built.
struct Moved {
  Mesh mesh;
  WideBvh tree;
  WideCosts costs, fresh;
};

class WideRestructuring : public testing::TestWithParam<Way> {
 protected:
  Moved move(const Mesh& still, const Motion& motion) { return move(build(still, GetParam()), still, motion); }
  Moved move(const WideBvh& tree, const Mesh& still, const Motion& motion) {
    Moved result;
    result.mesh = moved(still, motion);
    result.fresh = measure_wide_costs(tree, pool_, cancel_);
    result.costs = refit_wide(tree, plan_of(tree, result.mesh), result.mesh, result.tree, false, pool_, cancel_);
    return result;
  }
  void expect_sound(const Moved& now, const std::string& name) {
    EXPECT_EQ(find_wide_fault(now.tree, now.mesh, true), "") << name;
    expect_tight(now.tree, now.mesh, name);
    const WideCosts costs = measure_wide_costs(now.tree, pool_, cancel_);
    EXPECT_FLOAT_EQ(static_cast<float>(now.costs.whole(now.tree)), static_cast<float>(costs.whole(now.tree))) << name;
  }

  ThreadPool pool_{1};
  CancelToken cancel_;
};
INSTANTIATE_TEST_SUITE_P(Ways, WideRestructuring, testing::ValuesIn(ways()),
                         [](const auto& test) { return test.param.name; });

TEST_P(WideRestructuring, RotationsGiveSoundTreesOfNoHigherCost) {
  for (const NamedMesh& input : hard_meshes()) {
    const WideBvh tree = build(input.mesh, GetParam());
    for (const Motion& motion : motions()) {
      const std::string name = input.name + ", " + motion.name;
      Moved now = move(tree, input.mesh, motion);
      const double before = now.costs.whole(now.tree);
      for (int i = 0; i < 2; ++i) static_cast<void>(rotate_wide(now.tree, now.costs, pool_, cancel_));
      expect_sound(now, name);
      EXPECT_LE(now.costs.whole(now.tree), before * (1 + 1e-5)) << name;
    }
  }
}

TEST_P(WideRestructuring, RebuiltPartsGiveSoundTrees) {
  for (const NamedMesh& input : hard_meshes()) {
    const WideBvh tree = build(input.mesh, GetParam());
    for (const Motion& motion : motions()) {
      const Moved moved = move(tree, input.mesh, motion);
      for (const double tolerance : {0.0, 1.05, 1.3}) {
        const std::string name = input.name + ", " + motion.name + ", " + std::to_string(tolerance);
        Moved now = moved;
        const auto parts = find_degraded_parts(now.tree, now.costs, now.fresh, tolerance, cancel_);
        if (now.tree.nodes.empty()) {
          EXPECT_TRUE(parts.empty()) << name;
        }
        now.costs = rebuild_parts(now.tree, now.fresh, parts, GetParam().config, pool_, cancel_);
        expect_sound(now, name);
        EXPECT_EQ(now.fresh.nodes.size(), now.tree.nodes.size()) << name;
      }
    }
  }
}

TEST_P(WideRestructuring, RestructuresATwist) {
  const Moved twisted = move(bumpy_sheet(150), {"", [](Positions& p) { twist(p, 25.0f); }});
  const double refitted = twisted.costs.whole(twisted.tree);
  Moved rotated = twisted, rebuilt = twisted;
  EXPECT_GT(rotate_wide(rotated.tree, rotated.costs, pool_, cancel_), 0u);
  const auto parts = find_degraded_parts(rebuilt.tree, rebuilt.costs, rebuilt.fresh, 1.1, cancel_);
  ASSERT_FALSE(parts.empty());
  rebuilt.costs = rebuild_parts(rebuilt.tree, rebuilt.fresh, parts, {}, pool_, cancel_);
  EXPECT_LT(rotated.costs.whole(rotated.tree), refitted);
  EXPECT_LT(rebuilt.costs.whole(rebuilt.tree), 0.95 * refitted);
}

TEST_P(WideRestructuring, GivesTheSameBytesForAnyThreadCount) {
  const Moved twisted = move(bumpy_sheet(150), motions()[1]);
  Moved alone = twisted;
  static_cast<void>(rotate_wide(alone.tree, alone.costs, pool_, cancel_));
  const auto parts = find_degraded_parts(alone.tree, alone.costs, alone.fresh, 1.02, cancel_);
  alone.costs = rebuild_parts(alone.tree, alone.fresh, parts, {}, pool_, cancel_);
  for (const int thread_count : thread_counts()) {
    ThreadPool pool(thread_count);
    Moved shared = twisted;
    static_cast<void>(rotate_wide(shared.tree, shared.costs, pool, cancel_));
    EXPECT_EQ(find_degraded_parts(shared.tree, shared.costs, shared.fresh, 1.02, cancel_), parts);
    shared.costs = rebuild_parts(shared.tree, shared.fresh, parts, {}, pool, cancel_);
    EXPECT_TRUE(same_bytes(alone.tree, shared.tree));
    EXPECT_EQ(alone.costs.nodes, shared.costs.nodes);
    EXPECT_EQ(alone.fresh.nodes, shared.fresh.nodes);
  }
}

// One limb of several moves: parts far from it are not rebuilt.
TEST(WideRestructuring, RebuildsOnlyWhatIsDegraded) {
  ThreadPool pool(1);
  CancelToken cancel;
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    Mesh limb = bumpy_sheet(40);
    for (Vec3f& p : limb.positions) p.x += 10.0f * static_cast<float>(i);
    append(mesh, limb);
  }
  const WideBvh still = build(mesh, {"", {}});
  WideCosts fresh = measure_wide_costs(still, pool, cancel);
  for (Vec3f& p : mesh.positions) {
    if (p.x < 5.0f) p.y = std::abs(std::fmod(4.0f * p.y, 2.0f) - 1.0f), p.z *= 0.1f;  // folded four times
  }
  WideBvh tree;
  const WideCosts costs = refit_wide(still, plan_of(still, mesh), mesh, tree, false, pool, cancel);
  const auto parts = find_degraded_parts(tree, costs, fresh, 1.1, cancel);
  ASSERT_FALSE(parts.empty());
  for (const std::uint32_t part : parts) {
    Aabb box;
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) box.grow(child_box(tree.nodes[part], lane));
    EXPECT_LT(box.upper.x, 5.0f);
  }
  static_cast<void>(rebuild_parts(tree, fresh, parts, {}, pool, cancel));
  EXPECT_EQ(find_wide_fault(tree, mesh, true), "");
}

// The scene's own choice, over a sequence of frames that bend the mesh further and further.
TEST(WideRestructuring, AScenesHitsAreRightWhateverItDoes) {
  ThreadPool pool(2);
  CancelToken cancel;
  const Mesh still = bumpy_sheet(30);
  Scene scene;
  const InstanceInput instance{scene.add_mesh(Mesh(still), {}, Usage::kDeforming), Affine{}, ~0u, {}};
  static_cast<void>(scene.add_instances({&instance, 1}));
  static_cast<void>(scene.commit(pool, cancel));
  std::vector<std::size_t> counts(6);
  for (int frame = 1; frame <= 40; ++frame) {
    Mesh mesh = still;
    twist(mesh.positions, 0.3f * static_cast<float>(frame));
    if (frame == 40) motions()[3].apply(mesh.positions);  // shuffle
    scene.update_mesh<float>(instance.mesh_id, mesh.positions);
    ++counts[static_cast<std::size_t>(scene.commit(pool, cancel).meshes[0].action)];
    const std::vector<Ray> rays = rays_at(mesh, 60);
    std::vector<Hit> hits(rays.size());
    trace_closest(*scene.snapshot(), rays, hits);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Hit expected = reference_closest(*scene.snapshot(), rays[i], Cull::kNone);
      ASSERT_EQ(hits[i].primitive_index, expected.primitive_index) << frame << ", ray " << i;
      ASSERT_EQ(hits[i].t, expected.t) << frame << ", ray " << i;
    }
  }
  for (const MeshAction action :
       {MeshAction::kRefitted, MeshAction::kRotated, MeshAction::kPartlyRebuilt, MeshAction::kRebuilt}) {
    EXPECT_GT(counts[static_cast<std::size_t>(action)], 0u) << static_cast<int>(action);
  }
}

}  // namespace
}  // namespace perfect_bvh::test
