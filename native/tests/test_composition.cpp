// Composed trees are sound, and every ray has the same hit as before.
#include <gtest/gtest.h>

#include <cstring>

#include "builders/builder.h"
#include "builders/link_tree.h"
#include "core/errors.h"
#include "query/trace.h"
#include "tests/box_sets.h"
#include "tests/reference_trace.h"
#include "tests/tree_faults.h"
#include "tlas/assemble.h"
#include "tlas/instance.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"

namespace perfect_bvh::test {
namespace {

Bvh2 build(const std::vector<PrimRef>& refs, BuilderKind kind = BuilderKind::kBinned, std::uint32_t leaf_size = 8) {
  ThreadPool pool(1);
  CancelToken cancel;
  BuildConfig config;
  config.builder = kind;
  config.max_leaf_size = leaf_size;
  return build_bvh2(refs, config, pool, cancel);
}

Mesh soup(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-1.0f, 1.0f), side(-0.25f, 0.25f);
  std::vector<Vec3f> positions;
  std::vector<Vec3<std::int32_t>> triangles;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f corner{place(random), place(random), place(random)};
    const auto first = static_cast<std::int32_t>(positions.size());
    positions.push_back(corner);
    for (int k = 0; k < 2; ++k) positions.push_back(corner + Vec3f{side(random), side(random), side(random)});
    triangles.push_back({first, first + 1, first + 2});
  }
  return make_mesh(positions, triangles, "test");
}

std::vector<PrimRef> refs_of(const Mesh& mesh, std::size_t begin, std::size_t end) {
  std::vector<PrimRef> refs;
  for (std::size_t i = begin; i < end; ++i) {
    const Aabb box = mesh.primitive_box(i);
    refs.push_back({box.lower, static_cast<std::uint32_t>(i - begin), box.upper, 0});
  }
  return refs;
}

// Tests every ray against every triangle, and against the tree.
void expect_right_hits(const Mesh& mesh, const Bvh2& tree) {
  ThreadPool pool(1);
  CancelToken cancel;
  auto blas = std::make_shared<Blas>(std::make_shared<const Mesh>(mesh));
  blas->box = tree.bounds();
  blas->wide = collapse_mesh(tree, mesh, pool, cancel);
  Snapshot snapshot;
  snapshot.blases.push_back(blas);
  Instance& instance = snapshot.instances.emplace_back(Instance{});
  instance.id = 0, instance.mesh_id = 0;
  Placing placing;
  ASSERT_TRUE(place_instance(instance, placing, *blas, Affine{}));
  const Aabb& box = placing.world_bounds;
  snapshot.instance_views.push_back(view_of(instance, placing.world_to_object));
  snapshot.bounds = mesh_bounds_of(instance);
  snapshot.top_level = build_fast_top_level(std::vector<PrimRef>{{box.lower, 0, box.upper, 0}}, pool, cancel);
  make_trace_view(snapshot, pool, cancel);

  std::mt19937 random(9);
  std::uniform_real_distribution<double> place(-2.0, 2.0);
  std::vector<Ray> rays(1500);
  for (Ray& ray : rays) {
    ray.origin = {place(random), place(random), place(random)};
    ray.direction = Vec3d{place(random), place(random), place(random)} * 0.3 - ray.origin;
  }
  std::vector<Hit> hits(rays.size());
  trace_closest(snapshot, rays, hits);
  std::size_t found = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Hit expected = reference_closest(snapshot, rays[i], Cull::kNone);
    ASSERT_EQ(hits[i].found(), expected.found()) << i;
    if (!expected.found()) continue;
    ++found;
    ASSERT_EQ(hits[i].primitive_index, expected.primitive_index) << i;
    ASSERT_EQ(hits[i].t, expected.t) << i;
  }
  EXPECT_GT(found, rays.size() / 4);
}

// Lists the primitives below a node, in order.
void gather(const Bvh2& tree, std::size_t node, std::vector<std::uint32_t>& prims) {
  const Bvh2Node& now = tree.nodes[node];
  for (std::uint32_t i = 0; i < now.count; ++i) prims.push_back(tree.prim_indices[now.first + i]);
  if (now.is_leaf()) return;
  gather(tree, now.first, prims);
  gather(tree, now.first + 1, prims);
}

std::vector<std::uint32_t> prims_below(const Bvh2& tree, std::size_t node) {
  std::vector<std::uint32_t> prims;
  gather(tree, node, prims);
  return prims;
}

TEST(Combine, PutsTwoTreesUnderOneRoot) {
  const Mesh mesh = soup(600, 1);
  const Bvh2 left = build(refs_of(mesh, 0, 200)), right = build(refs_of(mesh, 200, 600), BuilderKind::kMedian, 3);
  const Bvh2 tree = combine(left, right, 200);
  EXPECT_EQ(find_fault(tree, 600), "");
  EXPECT_EQ(tree.depth, 1 + std::max(left.depth, right.depth));
  EXPECT_EQ(tree.node_count(), left.node_count() + right.node_count() + 1);
  EXPECT_EQ(prims_below(tree, tree.nodes[0].first), prims_below(left, 0));
  expect_right_hits(mesh, tree);
}

TEST(Combine, CanBeRepeated) {
  const Mesh mesh = soup(500, 2);
  Bvh2 tree;
  for (std::size_t begin = 0; begin < 500; begin += 100) {
    tree = combine(tree, build(refs_of(mesh, begin, begin + 100)), static_cast<std::uint32_t>(begin));
    ASSERT_EQ(find_fault(tree, begin + 100), "");
  }
  expect_right_hits(mesh, tree);
}

TEST(Combine, TakesEmptyTreesAndSingleLeaves) {
  const Bvh2 leaf = build(repeated(3, {0, 0, 0}, {1, 1, 1}));
  ASSERT_EQ(leaf.nodes.size(), 1u);
  EXPECT_TRUE(combine({}, {}, 0).empty());
  EXPECT_EQ(find_fault(combine(leaf, {}, 3), 3), "");
  EXPECT_EQ(prims_below(combine({}, leaf, 3), 0), (std::vector<std::uint32_t>{3, 4, 5}));
  EXPECT_EQ(find_fault(combine(leaf, leaf, 3), 6), "");
}

TEST(Combine, RemembersWhatCannotBeRefitted) {
  const Bvh2 plain = build(scattered(50));
  Bvh2 clipped = plain;
  clipped.refittable = false;
  EXPECT_TRUE(combine(plain, plain, 50).refittable);
  EXPECT_FALSE(combine(plain, clipped, 50).refittable);
  EXPECT_FALSE(combine(clipped, plain, 50).refittable);
}

TEST(Combine, RefusesTreesThatBecomeTooDeep) {
  Bvh2 tree = build(scattered(2), BuilderKind::kBinned, 1);
  while (tree.depth < kMaxTreeDepth) {
    tree = combine(tree, build(scattered(1)), static_cast<std::uint32_t>(tree.prim_indices.size()));
  }
  EXPECT_EQ(find_fault(tree, tree.prim_indices.size()), "");
  EXPECT_THROW((void)combine(tree, build(scattered(1)), 1000), InvalidArgument);
}

}  // namespace
}  // namespace perfect_bvh::test
