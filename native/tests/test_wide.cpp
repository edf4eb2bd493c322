// The collapsed tree has the content of the binary one, for any input: every triangle, inside every box above it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "blas/build_tree.h"
#include "builders/builder.h"
#include "core/errors.h"
#include "tests/mesh_sets.h"
#include "tests/same_bytes.h"
#include "tests/thread_counts.h"
#include "tests/tree_faults.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"
#include "wide/leaf_block.h"
#include "wide/small_set.h"

namespace perfect_bvh::test {
namespace {

// Boxes inside boxes: as deep as a builder lets the tree become.
Mesh nested(std::uint32_t count) {
  Mesh mesh;
  for (std::uint32_t i = 0; i < count; ++i) {
    const float size = std::ldexp(1.0f, -static_cast<int>(i % 100));
    mesh.positions.insert(mesh.positions.end(), {{-size, -size, -size}, {size, size, size}, {size, -size, size}});
    mesh.triangles.edit().push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

std::vector<NamedMesh> inputs() {
  return {{"one", triangle_soup(1, 0.1f)},
          {"two", triangle_soup(2, 0.1f)},
          {"nine", triangle_soup(9, 0.1f)},
          {"soup", triangle_soup(3000, 0.05f)},
          {"large_triangles", triangle_soup(500, 2.0f)},
          {"sheet", bumpy_sheet(60)},
          {"repeated", repeated_triangle(1000)},
          {"nested", nested(400)},
          {"tiny", scaled(triangle_soup(300, 0.1f), 1e-30f)},
          {"huge", scaled(triangle_soup(300, 0.1f), 1e17f)}};
}

Bvh2 build(const Mesh& mesh, std::uint32_t max_leaf_size) {
  AlignedVector<PrimRef> prims(mesh.primitive_count());
  for (std::size_t i = 0; i < prims.size(); ++i) {
    const Aabb box = mesh.primitive_box(i);
    prims[i] = {box.lower, static_cast<std::uint32_t>(i), box.upper, 0};
  }
  BuildConfig config;
  config.max_leaf_size = max_leaf_size;
  ThreadPool pool(1);
  CancelToken cancel;
  return build_bvh2(prims, config, pool, cancel);
}

WideBvh collapse(const Bvh2& tree, const Mesh& mesh, int thread_count = 1) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  return collapse_mesh(tree, mesh, pool, cancel);
}

class Checker {
 public:
  Checker(const WideBvh& wide, const Mesh& mesh) : wide_(wide), mesh_(mesh) {}

  void check(std::uint32_t child, const Aabb& box, std::uint32_t depth) {
    if (child >= kBlockChild) {
      check_leaf(child - kBlockChild, box);
      return;
    }
    ASSERT_LE(depth, wide_.depth);
    ASSERT_TRUE(seen_nodes.insert(child).second) << "node " << child << " is reached twice";
    const WideNode& node = wide_.nodes[child];
    check_order(node);
    for (std::uint32_t lane = 0; lane < 8; ++lane) {
      const Aabb inner{{node.planes[0][lane], node.planes[2][lane], node.planes[4][lane]},
                       {node.planes[1][lane], node.planes[3][lane], node.planes[5][lane]}};
      if (node.child[lane] == kNoChild) {
        EXPECT_TRUE(inner.is_empty());
        continue;
      }
      EXPECT_TRUE(box.contains(inner)) << "node " << child << " lane " << lane;
      check(node.child[lane], inner, depth + 1);
    }
  }

  std::set<std::uint32_t> seen_nodes;
  std::multiset<std::uint32_t> seen_triangles;

 private:
  // All slots are named once, and the occupied ones from far to near.
  static void check_order(const WideNode& node) {
    const auto count = static_cast<std::uint32_t>(8 - std::count(node.child, node.child + 8, kNoChild));
    for (std::uint32_t octant = 0; octant < 8; ++octant) {
      std::uint32_t lanes = 0;
      float last = std::numeric_limits<float>::infinity();
      for (std::uint32_t place = 0; place < 8; ++place) {
        const std::uint32_t lane = node.order[place] >> (3 * octant) & 7;
        lanes |= 1u << lane;
        if (place >= count) continue;
        float distance = 0;
        for (std::uint32_t axis = 0; axis < 3; ++axis) {
          const float centre = node.planes[2 * axis][lane] * 0.5f + node.planes[2 * axis + 1][lane] * 0.5f;
          distance += octant >> axis & 1 ? -centre : centre;
        }
        EXPECT_LE(distance, last + 0x1p-19f * (std::abs(last) + 0x1p-10f)) << "octant " << octant << " place " << place;
        last = distance;
      }
      EXPECT_EQ(lanes, 0xFFu) << "octant " << octant;
    }
  }

  void check_leaf(std::uint32_t row, const Aabb& box) {
    const LeafBlock& block = wide_.blocks[row];
    const std::uint32_t* const primitives = block.primitives;
    for (int lane = 0; lane < 8; ++lane) {
      if (lane == 0 || primitives[lane] != primitives[lane - 1]) seen_triangles.insert(primitives[lane]);
      ASSERT_TRUE(lane == 0 || primitives[lane] >= primitives[lane - 1]);
      const TriangleIndices corners = mesh_.triangles[primitives[lane]];
      const std::uint32_t vertices[3] = {corners.x, corners.y, corners.z};
      for (int corner = 0; corner < 3; ++corner) {
        const Vec3f expected = mesh_.positions[vertices[corner]] * wide_.scale;
        EXPECT_TRUE(box.contains({expected, expected}));
        const std::uint32_t place = block.corners[lane] >> (4 * corner) & 7;
        EXPECT_EQ((Vec3f{block.vertices[0][place], block.vertices[1][place], block.vertices[2][place]}), expected);
      }
    }
  }

  const WideBvh& wide_;
  const Mesh& mesh_;
};

void expect_sound(const WideBvh& wide, const Bvh2& tree, const Mesh& mesh) {
  const Aabb box = tree.bounds();
  ASSERT_FALSE(wide.is_empty);
  Checker checker(wide, mesh);
  checker.check(wide.root, {box.lower * wide.scale, box.upper * wide.scale}, 1);
  EXPECT_EQ(checker.seen_nodes.size(), wide.nodes.size());
  ASSERT_EQ(checker.seen_triangles.size(), mesh.primitive_count());
  for (std::uint32_t i = 0; i < mesh.primitive_count(); ++i) EXPECT_EQ(checker.seen_triangles.count(i), 1u) << i;
}

class Wide : public testing::TestWithParam<std::uint32_t> {};
INSTANTIATE_TEST_SUITE_P(LeafSizes, Wide, testing::Values(1u, 2u, 8u, 200u));

TEST_P(Wide, HoldsEveryTriangleOnceInsideItsBoxes) {
  for (const NamedMesh& input : inputs()) {
    SCOPED_TRACE(input.name);
    const Bvh2 tree = build(input.mesh, GetParam());
    expect_sound(collapse(tree, input.mesh), tree, input.mesh);
  }
}

Bvh2 build_filled(const Mesh& mesh, int thread_count = 1) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  const BuildConfig config = choose_builder({}, Usage::kStatic);
  EXPECT_TRUE(config.fills_leaves);
  return build_tree(mesh, config, pool, cancel);
}

std::vector<std::uint32_t> primitives_below(const Bvh2& tree, std::uint32_t index) {
  const Bvh2Node& node = tree.nodes[index];
  if (node.is_leaf()) {
    const auto first = tree.prim_indices.begin() + node.first;
    return {first, first + node.count};
  }
  std::vector<std::uint32_t> left = primitives_below(tree, node.first), right = primitives_below(tree, node.first + 1);
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

TEST(FilledLeaves, HoldWhatFitsAndNoNodeAboveThemWould) {
  for (const NamedMesh& input : inputs()) {
    SCOPED_TRACE(input.name);
    const Bvh2 tree = build_filled(input.mesh);
    EXPECT_EQ(find_fault(tree, input.mesh.primitive_count()), "");
    EXPECT_TRUE(tree.has_full_leaves);
    for (std::uint32_t i = 0; i < tree.nodes.size(); ++i) {
      if (i == 1) continue;
      std::set<std::uint32_t> vertices;
      const std::vector<std::uint32_t> primitives = primitives_below(tree, i);
      for (const std::uint32_t primitive : primitives) {
        const TriangleIndices corners = input.mesh.triangles[primitive];
        vertices.insert({corners.x, corners.y, corners.z});
      }
      EXPECT_EQ(tree.nodes[i].is_leaf(), primitives.size() <= 8 && vertices.size() <= 8) << "node " << i;
    }
    expect_sound(collapse(tree, input.mesh), tree, input.mesh);
  }
}

TEST(FilledLeaves, AreTheSameForAnyNumberOfThreads) {
  const Mesh mesh = bumpy_sheet(180);
  const Bvh2 one = build_filled(mesh);
  for (const int thread_count : thread_counts()) {
    const Bvh2 more = build_filled(mesh, thread_count);
    EXPECT_TRUE(same_bytes(one, more));
  }
}

TEST(FilledLeaves, AreFullerThanThoseByCost) {
  const Mesh mesh = bumpy_sheet(100);
  const WideBvh filled = collapse(build_filled(mesh), mesh);
  EXPECT_LE(filled.leaf_count(), collapse(build(mesh, 8), mesh).leaf_count());
  EXPECT_GT(static_cast<double>(mesh.primitive_count()) / static_cast<double>(filled.leaf_count()), 5.0);
}

TEST(FillingLeaves, IsNotForThoseWhoSetCosts) {
  BuildConfig config;
  config.max_leaf_size = 4;
  EXPECT_FALSE(choose_builder(config, Usage::kStatic).fills_leaves);
  config = {};
  config.traversal_cost = 2.0f;
  EXPECT_FALSE(choose_builder(config, Usage::kDeforming).fills_leaves);
  config = {};
  config.builder = BuilderKind::kBinned;
  EXPECT_FALSE(choose_builder(config, Usage::kStatic).fills_leaves);
}

TEST(WideBvh, IsTheSameForAnyNumberOfThreads) {
  for (const Mesh& mesh : {bumpy_sheet(150), triangle_soup(40000, 0.02f), nested(30000)}) {
    const Bvh2 tree = build(mesh, 4);
    const WideBvh one = collapse(tree, mesh);
    for (const int thread_count : thread_counts()) {
      EXPECT_TRUE(same_bytes(one, collapse(tree, mesh, thread_count)));
    }
  }
}

// A commit reports progress: for each triangle one unit of work for a binary tree, and one for a wide tree.
TEST(WideBvh, CountsItsWork) {
  const Mesh mesh = bumpy_sheet(200);
  const Bvh2 tree = build(mesh, 2);
  for (const int thread_count : {1, 3}) {
    ThreadPool pool(thread_count);
    CancelToken cancel;
    cancel.expect(2 * mesh.primitive_count());
    (void)collapse_mesh(tree, mesh, pool, cancel);
    EXPECT_GT(cancel.fraction(), 0.49f);
    EXPECT_LE(cancel.fraction(), 0.5f);
    cancel.expect(4 * mesh.primitive_count());
    (void)build_fast_wide(mesh, pool, cancel);
    EXPECT_EQ(cancel.fraction(), 0.5f);
  }
}

TEST(WideBvh, RefusesTreesInAnotherOrder) {
  const Mesh mesh = triangle_soup(4, 0.1f);
  const Aabb box = build(mesh, 4).bounds();
  Bvh2 tree;
  tree.prim_indices = {0, 1, 2, 3};
  for (const std::uint32_t first : {2u, 0u, 6u, 4u}) tree.nodes.push_back({box.lower, first, box.upper, 0});
  for (std::uint32_t row = 0; row < 4; ++row) tree.nodes.push_back({box.lower, row, box.upper, 1});
  EXPECT_THROW(collapse(tree, mesh), EngineError);
}

TEST(SmallSet, KeepsNumbersInTheOrderOfTheirComing) {
  SmallSet set;
  EXPECT_EQ(set.add(7), 0u);
  EXPECT_EQ(set.add(0), 1u);
  EXPECT_EQ(set.add(7), 0u);
  EXPECT_EQ(set.add(0x7FFFFFFEu), 2u);
  EXPECT_EQ(set.count(), 3u);
  const std::array<std::uint32_t, 8> expected{7,           0,           0x7FFFFFFEu, 0x7FFFFFFEu,
                                              0x7FFFFFFEu, 0x7FFFFFFEu, 0x7FFFFFFEu, 0x7FFFFFFEu};
  EXPECT_EQ(set.numbers(), expected);
  SmallSet other;
  for (const std::uint32_t number : {0u, 1u, 2u, 3u, 4u}) other.add(number);
  set.add(other);
  EXPECT_EQ(set.count(), 7u);
  EXPECT_EQ(set.add(100), 7u);
  EXPECT_FALSE(set.overflows());
  EXPECT_EQ(set.add(4), 6u);
  set.add(101);
  EXPECT_TRUE(set.overflows());
  set.add(4);
  EXPECT_TRUE(set.overflows());
}

TEST(SmallSet, TakesThreeAtOnceAsOneByOne) {
  std::mt19937 random(5);
  for (int round = 0; round < 2000; ++round) {
    SmallSet three, one;
    const auto draw = [&](std::uint32_t below) { return static_cast<std::uint32_t>(random() % below); };
    const std::uint32_t range = 2 + draw(12);
    for (int i = 0; i < 8 && !one.overflows(); ++i) {
      const std::uint32_t a = draw(range), b = draw(range), c = draw(range);
      const std::array<std::uint32_t, 3> places = three.add(a, b, c);
      const std::array<std::uint32_t, 3> expected{one.add(a), one.add(b), one.add(c)};
      ASSERT_EQ(three.overflows(), one.overflows());
      if (one.overflows()) break;
      ASSERT_EQ(places, expected);
      ASSERT_EQ(three.numbers(), one.numbers());
    }
  }
}

TEST(WideBvh, KeepsOrdinaryCoordinatesAndScalesExtremeOnes) {
  const auto scale_of = [](float factor) {
    const Mesh mesh = scaled(triangle_soup(20, 0.1f), factor);
    const WideBvh wide = collapse(build(mesh, 2), mesh);
    EXPECT_TRUE(wide.scale == 1.0f || (wide.extent.reach >= 1.0f && wide.extent.reach < 2.0f));
    return wide.scale;
  };
  EXPECT_EQ(scale_of(1.0f), 1.0f);
  EXPECT_EQ(scale_of(1e5f), 1.0f);
  EXPECT_EQ(scale_of(1e-5f), 1.0f);
  EXPECT_GT(scale_of(1e-12f), 1.0f);
  EXPECT_LT(scale_of(1e12f), 1.0f);
}

TEST(WideBvh, FillsItsLeavesOnSurfaces) {
  const Mesh mesh = bumpy_sheet(100);
  const WideBvh wide = collapse(build(mesh, 2), mesh);
  EXPECT_LT(static_cast<double>(wide.byte_count()) / static_cast<double>(mesh.primitive_count()), 60.0);
}

TEST(WideBvh, IsEmptyOverNothing) {
  const Mesh mesh;
  EXPECT_TRUE(collapse(build(mesh, 2), mesh).is_empty);
}

// A chain: each node's left child is a leaf, its right child the rest.
TEST(WideBvh, TakesTreesOfAnyDepth) {
  const std::uint32_t count = 100'000;
  const Mesh mesh = triangle_soup(count, 0.01f);
  Bvh2 tree;
  tree.nodes.resize(2 * count);
  tree.prim_indices.resize(count);
  Aabb all;
  for (std::uint32_t i = count; i-- > 0;) {
    const Aabb box = mesh.primitive_box(i);
    all.grow(box);
    tree.prim_indices[i] = i;
    // Node 0, then the pairs (2, 3), (4, 5), ...: leaf i and the rest after it.
    const std::uint32_t leaf = i + 1 < count ? 2 * i + 2 : 2 * i + 1;
    tree.nodes[i == 0 && count == 1 ? 0 : leaf] = {box.lower, i, box.upper, 1};
    const std::uint32_t rest = i == 0 ? 0 : 2 * i + 1;
    if (i + 1 < count) tree.nodes[rest] = {all.lower, 2 * i + 2, all.upper, 0};
  }
  tree.nodes[1] = {{}, 0, {}, 0};
  tree.depth = count - 1;
  const WideBvh wide = collapse(tree, mesh);
  std::vector<std::uint32_t> waiting{wide.root};
  std::size_t triangles = 0;
  while (!waiting.empty()) {
    const std::uint32_t child = waiting.back();
    waiting.pop_back();
    if (child >= kBlockChild) {
      const LeafBlock& block = wide.blocks[child - kBlockChild];
      triangles += std::set<std::uint32_t>(block.primitives, block.primitives + 8).size();
      continue;
    }
    for (const std::uint32_t next : wide.nodes[child].child) {
      if (next != kNoChild) waiting.push_back(next);
    }
  }
  EXPECT_EQ(triangles, count);
}

}  // namespace
}  // namespace perfect_bvh::test
