// Every builder, through the scene, on meshes that are hard for some methods: the trees are sound, every hit equals
// that of testing all triangles, the bytes are the same for any number of threads, and large meshes take bounded time
// and memory.
#include <gtest/gtest.h>

#include "blas/build_tree.h"
#include "builders/builder.h"
#include "builders/quality.h"
#include "query/trace.h"
#include "scene/scene.h"
#include "tests/mesh_sets.h"
#include "tests/reference_trace.h"
#include "tests/round_mesh_sets.h"
#include "tests/same_bytes.h"
#include "tests/thread_counts.h"
#include "tests/tree_faults.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"
#include "wide/wide_bvh.h"
#include "wide/wide_cost.h"

namespace perfect_bvh::test {
namespace {

struct Way {
  const char* name;
  BuildConfig config;
  Usage usage = Usage::kStatic;
};

std::ostream& operator<<(std::ostream& out, const Way& way) { return out << way.name; }

std::vector<Way> ways() {
  std::vector<Way> list;
  for (const auto& [kind, name] : kBuilders) {
    if (kind == BuilderKind::kAuto) continue;
    BuildConfig config;
    config.builder = kind;
    list.push_back({name, config, Usage::kDeforming});
  }
  BuildConfig optimized;
  optimized.builder = BuilderKind::kBinned;
  optimized.optimize_passes = 2;
  list.push_back({"optimized", optimized});
  list.push_back({"straight_to_wide", BuildConfig{}, Usage::kChanging});
  return list;
}

class HardInput : public testing::TestWithParam<Way> {
 protected:
  // Builds the wide tree that the scene would build; for the fast builder the one without settings for leaves.
  static WideBvh build(const Mesh& mesh, const Way& way, int thread_count) {
    ThreadPool pool(thread_count);
    CancelToken cancel;
    if (way.usage == Usage::kChanging) return build_fast_wide(mesh, pool, cancel);
    const Bvh2 tree = build_tree(mesh, way.config, pool, cancel);
    EXPECT_EQ(find_fault(tree, mesh.primitive_count()), "");
    return collapse_mesh(tree, mesh, pool, cancel);
  }
  static bool is_clipped(const Way& way) { return way.config.builder == BuilderKind::kSpatial; }
};
INSTANTIATE_TEST_SUITE_P(Ways, HardInput, testing::ValuesIn(ways()), [](const auto& test) { return test.param.name; });

TEST_P(HardInput, MakesSoundTrees) {
  for (const NamedMesh& input : hard_meshes()) {
    EXPECT_EQ(find_wide_fault(build(input.mesh, GetParam(), 1), input.mesh, !is_clipped(GetParam())), "") << input.name;
  }
}

TEST_P(HardInput, GivesTheHitsOfEveryTriangleTriedInTurn) {
  ThreadPool pool(1);
  for (const NamedMesh& input : hard_meshes()) {
    Scene scene;
    const std::int32_t mesh_id = scene.add_mesh(Mesh(input.mesh), GetParam().config, GetParam().usage);
    const InstanceInput instance{mesh_id, Affine{}, ~0u, {}};
    static_cast<void>(scene.add_instances({&instance, 1}));
    CancelToken cancel;
    static_cast<void>(scene.commit(pool, cancel));
    const auto snapshot = scene.snapshot();
    const std::vector<Ray> rays = rays_at(input.mesh, 200);
    std::vector<Hit> hits(rays.size());
    trace_closest(*snapshot, rays, hits);
    std::size_t found = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Hit expected = reference_closest(*snapshot, rays[i], Cull::kNone);
      found += expected.found();
      EXPECT_EQ(hits[i].primitive_index, expected.primitive_index) << input.name << ", ray " << i;
      EXPECT_EQ(hits[i].t, expected.t) << input.name << ", ray " << i;
    }
    if (input.name != "no area" && input.mesh.primitive_count() > 0) {
      EXPECT_GT(found, 20u) << input.name;
    }
  }
}

TEST_P(HardInput, GivesTheSameBytesForAnyThreadCount) {
  // The first is large enough that threads share every stage.
  for (const Mesh& mesh : {bumpy_sheet(200), repeated_triangle(70000), quad_among(triangle_soup(20000, 0.01f)),
                           shrinking_triangles(10000)}) {
    const WideBvh alone = build(mesh, GetParam(), 1);
    for (const int thread_count : thread_counts())
      EXPECT_TRUE(same_bytes(alone, build(mesh, GetParam(), thread_count)));
  }
}

TEST_P(HardInput, IsBuiltInBoundedMemory) {
#ifdef __SANITIZE_ADDRESS__
  constexpr std::size_t kLarge = 25'000;  // AddressSanitizer makes each ten times as slow
#else
  constexpr std::size_t kLarge = 100'000;
#endif
  for (const Mesh& mesh :
       {repeated_triangle(10 * kLarge), nested_triangles(kLarge), quad_among(triangle_soup(kLarge, 0.002f))}) {
    const WideBvh wide = build(mesh, GetParam(), 2);
    EXPECT_EQ(find_wide_fault(wide, mesh, !is_clipped(GetParam())), "");
    EXPECT_LE(wide.depth, kMaxTreeDepth);
    EXPECT_LE(wide.byte_count(), 300 * mesh.primitive_count());
  }
}

TEST_P(HardInput, StopsWhenAsked) {
  const Mesh mesh = bumpy_sheet(100);
  ThreadPool pool(2);
  CancelToken cancel;
  cancel.request_stop();
  if (GetParam().usage == Usage::kChanging) {
    EXPECT_THROW(static_cast<void>(build_fast_wide(mesh, pool, cancel)), Cancelled);
  } else {
    EXPECT_THROW(static_cast<void>(build_tree(mesh, GetParam().config, pool, cancel)), Cancelled);
  }
}

// The fast builder gives the same tree if it is named or chosen, and for every usage. It makes a binary tree first only
// if a setting needs one.
TEST(FastTree, IsTheSameForEveryUsage) {
  const Mesh mesh = bumpy_sheet(60);
  ThreadPool pool(1);
  CancelToken cancel;
  const auto tree_of = [&](const BuildConfig& config, Usage usage) {
    Scene scene;
    static_cast<void>(scene.add_mesh(Mesh(mesh), config, usage));
    static_cast<void>(scene.commit(pool, cancel));
    return scene.snapshot()->meshes.front().second->wide;
  };
  const WideBvh expected = build_fast_wide(mesh, pool, cancel);
  BuildConfig config;
  EXPECT_TRUE(same_bytes(expected, tree_of(config, Usage::kChanging)));
  config.builder = BuilderKind::kFast;
  for (const Usage usage : {Usage::kStatic, Usage::kDeforming, Usage::kChanging}) {
    EXPECT_TRUE(same_bytes(expected, tree_of(config, usage))) << usage_name(usage);
  }
  config.bins = 2, config.axes = 1;  // these are settings of other builders
  EXPECT_TRUE(same_bytes(expected, tree_of(config, Usage::kStatic)));
  config.max_leaf_size = 2;
  EXPECT_FALSE(same_bytes(expected, tree_of(config, Usage::kChanging)));
}

TEST(WideValidator, FindsFaults) {
  Mesh mesh = bumpy_sheet(20);
  ThreadPool pool(1);
  CancelToken cancel;
  WideBvh sound = build_fast_wide(mesh, pool, cancel);
  const auto fault_after = [&](const auto& damage) {
    WideBvh tree = sound;
    damage(tree);
    return find_wide_fault(tree, mesh, true);
  };
  EXPECT_EQ(fault_after([](WideBvh&) {}), "");
  EXPECT_NE(fault_after([](WideBvh& tree) { tree.nodes[0].planes[1][0] *= 0.5f; }), "");
  EXPECT_NE(fault_after([](WideBvh& tree) { tree.nodes[0].child[0] = tree.nodes[0].child[1]; }), "");
  EXPECT_NE(fault_after([](WideBvh& tree) { tree.nodes[0].child[0] = kNoChild; }), "");
  EXPECT_NE(fault_after([](WideBvh& tree) { tree.nodes[0].order[0] = tree.nodes[0].order[1]; }), "");
  EXPECT_NE(fault_after([](WideBvh& tree) { tree.blocks[0].vertices[0][0] += 0.1f; }), "");
  EXPECT_NE(fault_after([](WideBvh& tree) { tree.blocks[0].primitives[7] = 799; }), "");
  EXPECT_NE(fault_after([](WideBvh& tree) { ++tree.depth; }), "");
  mesh = cloud(800, 0.01f, 0.05f).points();
  sound = build_fast_wide(mesh, pool, cancel);
  EXPECT_EQ(fault_after([](WideBvh&) {}), "");
  EXPECT_NE(fault_after([](WideBvh& tree) { tree.nodes[0].planes[1][0] *= 0.5f; }), "");
  EXPECT_NE(fault_after([](WideBvh& tree) { tree.point_leaves[0].primitives[7] = 799; }), "");
  EXPECT_NE(fault_after([](WideBvh& tree) { tree.point_leaves[0] = tree.point_leaves[1]; }), "");
}

// The result must equal a sum computed by hand for a tree of one node over leaves.
TEST(WideQuality, CountsVisitsAndTests) {
  Mesh mesh;
  for (const float x : {0.0f, 10.0f}) {
    for (int i = 0; i < 3; ++i) {
      add_triangle(mesh, {x, 0, 0}, {x + 1, 0, 1}, {x, 1, static_cast<float>(i)});
    }
  }
  ThreadPool pool(1);
  CancelToken cancel;
  const WideBvh tree = build_fast_wide(mesh, pool, cancel);
  const TreeQuality quality = measure_wide_quality(tree, bounds_of(tree, mesh));
  double tests = 0;
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
    if (tree.nodes[0].child[lane] == kNoChild) continue;
    const double area = static_cast<double>(child_box(tree.nodes[0], lane).half_area());
    tests += area * triangle_count_of(tree, tree.nodes[0].child[lane] - kBlockChild);
  }
  EXPECT_EQ(tree.nodes.size(), 1u);
  EXPECT_EQ(quality.node_visits, 1.0);
  EXPECT_NEAR(quality.primitive_tests, tests / static_cast<double>(bounds_of(tree, mesh).half_area()), 1e-6);
  EXPECT_EQ(quality.reference_count, 6u);
  EXPECT_EQ(quality.leaf_count, tree.blocks.size());
}

}  // namespace
}  // namespace perfect_bvh::test
