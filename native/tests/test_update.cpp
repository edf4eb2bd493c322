// Refit, quality and the validator.
#include <gtest/gtest.h>

#include <cstring>

#include "builders/builder.h"
#include "builders/link_tree.h"
#include "builders/quality.h"
#include "core/errors.h"
#include "tests/box_sets.h"
#include "tests/tree_faults.h"

namespace perfect_bvh::test {
namespace {

Bvh2 build(const std::vector<PrimRef>& refs) {
  ThreadPool pool(1);
  CancelToken cancel;
  return build_bvh2(refs, {}, pool, cancel);
}

// Computes the boxes of a node from every primitive below it.
Aabb fresh_box(const Bvh2& tree, std::size_t index, const std::vector<Aabb>& boxes) {
  const Bvh2Node& node = tree.nodes[index];
  Aabb box;
  if (!node.is_leaf()) {
    box.grow(fresh_box(tree, node.first, boxes));
    box.grow(fresh_box(tree, node.first + 1, boxes));
  }
  for (std::uint32_t i = 0; i < node.count; ++i) box.grow(boxes[tree.prim_indices[node.first + i]]);
  return box;
}

void expect_fresh(const Bvh2& tree, const std::vector<Aabb>& boxes) {
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    if (i == 1) continue;
    const Aabb box = fresh_box(tree, i, boxes);
    ASSERT_EQ(box.lower, tree.nodes[i].lower) << i;
    ASSERT_EQ(box.upper, tree.nodes[i].upper) << i;
  }
}

struct Soup {
  std::vector<Vec3f> positions;
  std::vector<Vec3<std::uint32_t>> triangles;

  [[nodiscard]] std::vector<Aabb> boxes() const {
    std::vector<Aabb> result;
    for (const auto& t : triangles) {
      Aabb box;
      box.grow(positions[t.x]), box.grow(positions[t.y]), box.grow(positions[t.z]);
      result.push_back(box);
    }
    return result;
  }
  [[nodiscard]] std::vector<PrimRef> refs() const {
    std::vector<PrimRef> result;
    for (const Aabb& box : boxes()) result.push_back(make_ref(box.lower, box.upper, result.size()));
    return result;
  }
};

Soup random_soup(std::size_t vertex_count, std::size_t triangle_count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-1.0f, 1.0f);
  Soup mesh;
  for (std::size_t i = 0; i < vertex_count; ++i)
    mesh.positions.push_back({place(random), place(random), place(random)});
  std::uniform_int_distribution<std::uint32_t> near(0, 5);
  for (std::size_t i = 0; i < triangle_count; ++i) {
    const auto first = static_cast<std::uint32_t>(i % (vertex_count - 6));
    mesh.triangles.push_back({first, first + near(random), first + near(random)});
  }
  return mesh;
}

TEST(Refit, GivesFreshBoxesAfterAnyMotion) {
  Soup mesh = random_soup(3000, 20000, 1);
  for (int thread_count : {1, 3}) {
    ThreadPool pool(thread_count);
    CancelToken cancel;
    Bvh2 tree = build(mesh.refs());
    std::mt19937 random(2);
    std::uniform_real_distribution<float> place(-10.0f, 10.0f);
    for (Vec3f& p : mesh.positions) p = {place(random), place(random), place(random)};
    refit_bvh2(tree, mesh.refs(), pool, cancel);
    EXPECT_EQ(find_fault(tree, mesh.triangles.size()), "");
    expect_fresh(tree, mesh.boxes());
  }
}

TEST(Refit, OfUnmovedBoxesChangesNoByte) {
  const auto refs = hard_sets().back().refs;  // zeros of both signs
  ThreadPool pool(1);
  CancelToken cancel;
  const Bvh2 before = build(refs);
  Bvh2 after = before;
  refit_bvh2(after, refs, pool, cancel);
  EXPECT_EQ(std::memcmp(before.nodes.data(), after.nodes.data(), before.nodes.size() * sizeof(Bvh2Node)), 0);
}

TEST(Refit, WorksOnTreesOfNoneAndOne) {
  ThreadPool pool(1);
  CancelToken cancel;
  Bvh2 nothing;
  refit_bvh2(nothing, std::span<const PrimRef>{}, pool, cancel);
  EXPECT_TRUE(nothing.empty());
  Bvh2 one = build(scattered(1));
  refit_bvh2(one, repeated(1, {1, 2, 3}, {4, 5, 6}), pool, cancel);
  EXPECT_EQ(one.nodes[0].upper, (Vec3f{4, 5, 6}));
}

TEST(Refit, RefusesClippedTrees) {
  Bvh2 tree = build(scattered(20));
  tree.refittable = false;
  ThreadPool pool(1);
  CancelToken cancel;
  EXPECT_THROW(refit_bvh2(tree, scattered(20), pool, cancel), InvalidArgument);
}

TEST(Quality, MatchesAHandCountedTree) {
  // Two adjacent unit cubes, one primitive each: root 2x1x1 (half area 5), leaves 3 each.
  Bvh2 tree;
  tree.nodes = {{{0, 0, 0}, 2, {2, 1, 1}, 0}, {}, {{0, 0, 0}, 0, {1, 1, 1}, 1}, {{1, 0, 0}, 1, {2, 1, 1}, 1}};
  tree.prim_indices = {0, 1};
  tree.depth = 1;
  ASSERT_EQ(find_fault(tree, 2), "");
  const TreeQuality quality = measure_quality(tree);
  EXPECT_DOUBLE_EQ(quality.node_visits, 1.0);
  EXPECT_DOUBLE_EQ(quality.primitive_tests, (3 + 3) / 5.0);
  EXPECT_DOUBLE_EQ(quality.sah, (5 + 3 + 3) / 5.0);
  EXPECT_EQ(quality.node_count, 3u);
  EXPECT_EQ(quality.leaf_count, 2u);
  EXPECT_EQ(quality.reference_count, 2u);
  EXPECT_EQ(quality.depth, 1u);
}

TEST(Quality, IsFiniteWithoutArea) {
  const TreeQuality quality = measure_quality(build(points_on_line(100)));
  EXPECT_TRUE(std::isfinite(quality.sah));
}

// The validator must find each kind of damage.
class Validator : public testing::Test {
 protected:
  Bvh2 tree = build(scattered(100));
  std::size_t leaf() const {
    std::size_t index = tree.nodes.size() - 1;
    while (!tree.nodes[index].is_leaf()) --index;
    return index;
  }
  std::string fault() const { return find_fault(tree, 100); }
  bool finds(const char* words) const { return fault().find(words) != std::string::npos; }
};

TEST_F(Validator, AcceptsASoundTree) { EXPECT_EQ(fault(), ""); }
TEST_F(Validator, FindsAChildOutsideItsParent) {
  tree.nodes[leaf()].upper.x += 5.0f;
  EXPECT_TRUE(finds("does not contain")) << fault();
}
TEST_F(Validator, FindsAnInvertedBox) {
  std::swap(tree.nodes[leaf()].lower, tree.nodes[leaf()].upper);
  EXPECT_TRUE(finds("does not contain") || finds("empty")) << fault();
}
TEST_F(Validator, FindsNaN) {
  tree.nodes[0].lower.y = std::nanf("");
  EXPECT_TRUE(finds("NaN")) << fault();
}
TEST_F(Validator, FindsACycle) {
  tree.nodes[2].count = 0;
  tree.nodes[2].first = 2;
  EXPECT_TRUE(finds("after its children")) << fault();
}
TEST_F(Validator, FindsASharedChild) {
  std::size_t interior = 2;
  while (tree.nodes[interior].is_leaf()) ++interior;
  for (std::size_t other = 0; other < tree.nodes.size(); ++other) {
    if (other == 1 || other == interior || tree.nodes[other].is_leaf()) continue;
    if (tree.nodes[other].first <= interior) continue;
    tree.nodes[interior].first = tree.nodes[other].first;
    tree.nodes[interior].set_box(tree.nodes[0].box());
    break;
  }
  tree.nodes[2].set_box(tree.nodes[0].box());
  tree.nodes[3].set_box(tree.nodes[0].box());
  EXPECT_NE(fault(), "");
}
TEST_F(Validator, FindsALostPrimitive) {
  const std::uint32_t index = tree.nodes[leaf()].first;
  tree.prim_indices[index] = tree.prim_indices[index == 0 ? 1 : 0];
  EXPECT_TRUE(finds("in no leaf") || finds("two leaves")) << fault();
}
TEST_F(Validator, FindsAnUnknownPrimitive) {
  tree.prim_indices[5] = 100;
  EXPECT_TRUE(finds("no primitive")) << fault();
}
TEST_F(Validator, FindsRowsPastTheEnd) {
  tree.nodes[leaf()].first = 100;
  EXPECT_TRUE(finds("past prim_indices")) << fault();
}
TEST_F(Validator, FindsAWrongDepth) {
  ++tree.depth;
  EXPECT_TRUE(finds("depth")) << fault();
}
TEST_F(Validator, FindsAnUnreachableNode) {
  tree.nodes.resize(tree.nodes.size() + 2, tree.nodes[leaf()]);
  EXPECT_TRUE(finds("not reachable")) << fault();
}
TEST_F(Validator, FindsAnOddPair) {
  tree.nodes[0].first = 3;
  EXPECT_TRUE(finds("even index")) << fault();
}

}  // namespace
}  // namespace perfect_bvh::test
