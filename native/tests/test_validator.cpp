// Quality and the validator.
#include <gtest/gtest.h>

#include "builders/builder.h"
#include "builders/quality.h"
#include "tests/box_sets.h"
#include "tests/tree_faults.h"

namespace perfect_bvh::test {
namespace {

Bvh2 build(const std::vector<PrimRef>& refs) {
  ThreadPool pool(1);
  CancelToken cancel;
  return build_bvh2(refs, {}, pool, cancel);
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
