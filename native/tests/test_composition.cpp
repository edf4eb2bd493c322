// Trees put together, and parts of trees rebuilt: sound, and every ray meets what it met before.
#include <gtest/gtest.h>

#include <cstring>

#include "build/combine.h"
#include "core/errors.h"
#include "scene/cover.h"
#include "scene/instance_placing.h"
#include "scene/top_level.h"
#include "scene/trace.h"
#include "scene/trace_view.h"
#include "tests/box_sets.h"
#include "tests/reference_trace.h"
#include "update/partial_rebuild.h"
#include "update/quality.h"
#include "wide/collapse.h"

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

std::vector<Aabb> boxes_of(const std::vector<PrimRef>& refs) {
  std::vector<Aabb> boxes;
  for (const PrimRef& ref : refs) boxes.push_back(ref.box());
  return boxes;
}

TriangleMesh soup(std::size_t count, std::uint32_t seed) {
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

std::vector<PrimRef> refs_of(const TriangleMesh& mesh, std::size_t begin, std::size_t end) {
  std::vector<PrimRef> refs;
  for (std::size_t i = begin; i < end; ++i) {
    const Aabb box = mesh.triangle_box(i);
    refs.push_back({box.lower, static_cast<std::uint32_t>(i - begin), box.upper, 0});
  }
  return refs;
}

// Every ray against every triangle, and against the tree.
void expect_right_hits(const TriangleMesh& mesh, const Bvh2& tree) {
  ThreadPool pool(1);
  CancelToken cancel;
  auto blas = std::make_shared<Blas>(std::make_shared<const TriangleMesh>(mesh));
  blas->cover = make_cover(tree);
  blas->wide = collapse_mesh(tree, mesh, TreeLayout::kDefault, pool, cancel);
  Snapshot snapshot;
  snapshot.blases.push_back(blas);
  Instance& instance = snapshot.instances.emplace_back();
  instance.id = 0, instance.mesh_id = 0;
  Placing placing;
  ASSERT_TRUE(place_instance(instance, placing, *blas, Affine{}));
  const Aabb& box = placing.world_bounds;
  snapshot.instance_views.push_back(view_of(instance, placing.world_to_object));
  snapshot.tlas = build_top_level(std::vector<PrimRef>{{box.lower, 0, box.upper, 0}}, pool, cancel).tree;
  snapshot.top_level = collapse_top_level(snapshot.tlas, pool, cancel);
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

// The primitives below a node, in order.
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
  const TriangleMesh mesh = soup(600, 1);
  const Bvh2 left = build(refs_of(mesh, 0, 200)), right = build(refs_of(mesh, 200, 600), BuilderKind::kMedian, 3);
  const Bvh2 tree = combine(left, right, 200);
  EXPECT_EQ(find_fault(tree, 600), "");
  EXPECT_EQ(tree.depth, 1 + std::max(left.depth, right.depth));
  EXPECT_EQ(tree.node_count(), left.node_count() + right.node_count() + 1);
  EXPECT_EQ(prims_below(tree, tree.nodes[0].first), prims_below(left, 0));
  expect_right_hits(mesh, tree);
}

TEST(Combine, CanBeRepeated) {
  const TriangleMesh mesh = soup(500, 2);
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

bool rebuild(Bvh2& tree, std::uint32_t node, const std::vector<PrimRef>& refs, const BuildConfig& config = {}) {
  ThreadPool pool(1);
  CancelToken cancel;
  return rebuild_below(tree, node, boxes_of(refs), config, pool, cancel);
}

TEST(PartialRebuild, KeepsHitsAndTheRest) {
  const TriangleMesh mesh = soup(800, 3);
  const auto refs = refs_of(mesh, 0, 800);
  const Bvh2 before = build(refs, BuilderKind::kMedian, 4);
  for (const std::uint32_t side : {0u, 1u}) {
    Bvh2 tree = before;
    const std::uint32_t child = before.nodes[0].first + side, node = before.nodes[child].first + side;
    ASSERT_TRUE(rebuild(tree, node, refs));
    EXPECT_EQ(find_fault(tree, 800), "");
    EXPECT_LT(measure_quality(tree).sah, measure_quality(before).sah);
    const std::uint32_t kept = before.nodes[0].first + 1 - side;
    EXPECT_EQ(prims_below(tree, tree.nodes[0].first + 1 - side), prims_below(before, kept));
    EXPECT_EQ(tree.nodes[0].lower, before.nodes[0].lower);
    EXPECT_EQ(tree.nodes[0].upper, before.nodes[0].upper);
    expect_right_hits(mesh, tree);
  }
}

TEST(PartialRebuild, TakesTheRootAndLeaves) {
  const auto refs = scattered(300);
  BuildConfig config;
  config.max_leaf_size = 1;
  Bvh2 tree = build(refs, BuilderKind::kMedian);
  const auto leaf = static_cast<std::uint32_t>(tree.nodes.size() - 1);
  ASSERT_TRUE(rebuild(tree, leaf, refs, config));
  EXPECT_EQ(find_fault(tree, 300), "");
  ASSERT_TRUE(rebuild(tree, 0, refs, config));
  EXPECT_EQ(find_fault(tree, 300), "");
  EXPECT_EQ(measure_quality(tree).max_leaf_size, 1u);
}

TEST(PartialRebuild, LetsTheNodesAboveFitMovedBoxes) {
  auto refs = scattered(400);
  Bvh2 tree = build(refs);
  const std::uint32_t node = tree.nodes[tree.nodes[0].first + 1].first;
  for (const std::uint32_t prim : prims_below(tree, node)) {
    refs[prim].lower = refs[prim].lower + Vec3f{5, 5, 5};
    refs[prim].upper = refs[prim].upper + Vec3f{5, 5, 5};
  }
  ASSERT_TRUE(rebuild(tree, node, refs));
  EXPECT_EQ(find_fault(tree, 400), "");
  Aabb all;
  for (const PrimRef& ref : refs) all.grow(ref.box());
  EXPECT_EQ(tree.nodes[0].lower, all.lower);
  EXPECT_EQ(tree.nodes[0].upper, all.upper);
}

// Part of a mesh has moved: the tree is right again once that part is rebuilt over the new boxes.
TEST(PartialRebuild, MeetsMovedTriangles) {
  TriangleMesh mesh = soup(800, 5);
  const Bvh2 before = build(refs_of(mesh, 0, 800));
  const std::uint32_t node = before.nodes[before.nodes[0].first].first + 1;
  for (const std::uint32_t prim : prims_below(before, node)) {
    const TriangleIndices corners = mesh.triangles[prim];  // a soup: no vertex is shared
    for (const std::uint32_t vertex : {corners.x, corners.y, corners.z}) {
      mesh.positions[vertex] = mesh.positions[vertex] * 0.5f + Vec3f{0.3f, -0.4f, 0.2f};
    }
  }
  const auto refs = refs_of(mesh, 0, 800);
  for (const BuilderKind kind : {BuilderKind::kBinned, BuilderKind::kSweep, BuilderKind::kMedian, BuilderKind::kFast}) {
    BuildConfig config;
    config.builder = kind;
    Bvh2 tree = before;
    ASSERT_TRUE(rebuild(tree, node, refs, config));
    EXPECT_EQ(find_fault(tree, 800), "");
    expect_right_hits(mesh, tree);
  }
}

TEST(PartialRebuild, LeavesTheTreeAloneWhereItCannot) {
  const auto refs = cornered(2000);
  Bvh2 chain = build(repeated(2, {0, 0, 0}, {1, 1, 1}), BuilderKind::kMedian, 2);
  const Bvh2 single = build(repeated(1, {0, 0, 0}, {1, 1, 1}));
  while (chain.depth + 1 < kMaxTreeDepth) {
    chain = combine(single, chain, 1);
    for (std::uint32_t i = 0; i < chain.prim_indices.size(); ++i) chain.prim_indices[i] = i;
  }
  std::vector<PrimRef> boxes = repeated(chain.prim_indices.size(), {0, 0, 0}, {1, 1, 1});
  BuildConfig deep;
  deep.max_leaf_size = 1;
  // The lowest leaf holds two: one more level is just possible, and then the chain is full.
  ASSERT_TRUE(rebuild(chain, static_cast<std::uint32_t>(chain.nodes.size() - 1), boxes, deep));
  EXPECT_EQ(find_fault(chain, boxes.size()), "");
  Bvh2 clipped = build(refs);
  clipped.refittable = false;
  EXPECT_THROW((void)rebuild(clipped, 2, refs), InvalidArgument);
  Bvh2 tree = build(refs);
  EXPECT_THROW((void)rebuild(tree, 1, refs), InvalidArgument);
  EXPECT_THROW((void)rebuild(tree, static_cast<std::uint32_t>(tree.nodes.size()), refs), InvalidArgument);
}

TEST(PartialRebuild, RefusesWhatWouldBecomeTooDeep) {
  const Bvh2 single = build(repeated(1, {0, 0, 0}, {1, 1, 1}));
  Bvh2 chain = build(repeated(8, {0, 0, 0}, {1, 1, 1}));  // one leaf of 8
  while (chain.depth < kMaxTreeDepth - 2) chain = combine(single, chain, 1);
  const auto refs = repeated(chain.prim_indices.size(), {0, 0, 0}, {1, 1, 1});
  const Bvh2 before = chain;
  BuildConfig config;
  config.max_leaf_size = 1;  // 8 boxes need three levels
  std::uint32_t leaf = 0;
  while (!chain.nodes[leaf].is_leaf()) leaf = chain.nodes[leaf].first + 1;
  ASSERT_EQ(chain.nodes[leaf].count, 8u);
  EXPECT_FALSE(rebuild(chain, leaf, refs, config));
  ASSERT_EQ(chain.nodes.size(), before.nodes.size());
  EXPECT_EQ(std::memcmp(chain.nodes.data(), before.nodes.data(), before.nodes.size() * sizeof(Bvh2Node)), 0);
}

}  // namespace
}  // namespace perfect_bvh::test
