// Spatial splits: every point of every triangle stays in the box of a leaf that holds it, wherever it is split; the
// budget holds; the bytes are the same for any number of threads; hard input terminates.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

#include "blas/build_tree.h"
#include "builders/builder.h"
#include "builders/quality.h"
#include "mesh/clip.h"
#include "tests/box_sets.h"
#include "tests/same_bytes.h"
#include "tests/thread_counts.h"
#include "tests/tree_faults.h"

namespace perfect_bvh::test {
namespace {

BuildConfig spatial(float budget = 0.3f) {
  BuildConfig config;
  config.builder = BuilderKind::kSpatial;
  config.duplication_budget = budget;
  return config;
}

BuildConfig greedy(float budget) {  // splits as often as it may
  BuildConfig config = spatial(budget);
  config.traversal_cost = 0.01f;
  return config;
}

Bvh2 build(const std::vector<PrimRef>& refs, const BuildConfig& config, int thread_count = 1) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  return build_bvh2(refs, config, pool, cancel);
}

Bvh2 build(const Mesh& mesh, const BuildConfig& config, int thread_count = 1) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  return build_tree(mesh, config, pool, cancel);
}

// Returns the first fault of a tree of spatial splits that boxes alone can show.
std::string fault_of(const Bvh2& tree, std::size_t count, const BuildConfig& config) {
  const std::string fault = find_fault(tree, count);
  if (!fault.empty()) return fault;
  if (tree.refittable) return "passes for refittable";
  const double most = static_cast<double>(count) * (1.0 + static_cast<double>(config.duplication_budget));
  if (static_cast<double>(tree.prim_indices.size()) > most) return "more references than the budget allows";
  std::size_t rows = 0;
  for (const Bvh2Node& node : tree.nodes) {
    if (node.count > config.max_leaf_size) return "a leaf is too large";
    if (node.is_leaf() && node.first != rows) return "unused rows between leaves";
    rows += node.count;
    const auto first = tree.prim_indices.begin() + node.first;
    std::vector<std::uint32_t> prims(first, first + node.count);
    std::sort(prims.begin(), prims.end());
    if (std::adjacent_find(prims.begin(), prims.end()) != prims.end()) return "a primitive twice in one leaf";
  }
  return rows == tree.prim_indices.size() ? "" : "rows that no leaf refers to";
}

// Meshes ------------------------------------------------------------------------------------------------------------

// Coordinates are multiples of 2^-20 of at most 2^3 times `scale`, a power of two: weighted means with weights of a few
// bits are exact in double.
class MeshMaker {
 public:
  explicit MeshMaker(std::uint32_t seed, float scale = 1.0f) : random_(seed), scale_(scale) {}

  Vec3f point(float size) { return {number(size), number(size), number(size)}; }
  void add(Vec3f a, Vec3f b, Vec3f c) {
    const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
    for (const Vec3f p : {a, b, c}) mesh_.positions.push_back(p * scale_);
    mesh_.triangles.edit().push_back({first, first + 1, first + 2});
  }
  float number(float size) {
    const auto steps = static_cast<std::int32_t>(size * 0x1p20f);
    return static_cast<float>(static_cast<std::int32_t>(random_() % static_cast<std::uint32_t>(2 * steps + 1)) -
                              steps) *
           0x1p-20f;
  }
  [[nodiscard]] Mesh take() { return std::move(mesh_); }

 private:
  std::mt19937 random_;
  float scale_;
  Mesh mesh_;
};

Mesh soup(std::size_t count, float size, std::uint32_t seed, float scale = 1.0f) {
  MeshMaker maker(seed, scale);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f at = maker.point(1.0f);
    maker.add(at + maker.point(size), at + maker.point(size), at + maker.point(size));
  }
  return maker.take();
}

Mesh slivers(std::size_t count, std::uint32_t seed, float scale = 1.0f) {
  MeshMaker maker(seed, scale);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f a = maker.point(1.0f), b = maker.point(1.0f);
    maker.add(a, b, a + maker.point(i % 2 == 0 ? 0x1p-19f : 0x1p-8f));
  }
  return maker.take();
}

Mesh flat(std::size_t count, std::uint32_t seed) {
  MeshMaker maker(seed);
  for (std::size_t i = 0; i < count; ++i) {
    Vec3f corners[3];
    const float height = maker.number(1.0f);
    for (Vec3f& corner : corners) {
      corner = maker.point(1.0f);
      corner[static_cast<int>(i % 3)] = height;
    }
    maker.add(corners[0], corners[1], corners[2]);
  }
  return maker.take();
}

Mesh repeated_triangle(std::size_t count) {
  MeshMaker maker(1);
  for (std::size_t i = 0; i < count; ++i) maker.add({0, 0, 0}, {1, 0.5f, 0.25f}, {0.75f, 1, 0.5f});
  return maker.take();
}

// Points of a triangle, exact: corners, points on edges, and inside.
std::vector<Vec3d> points_of(const Vec3f (&corners)[3]) {
  constexpr int kParts = 16;
  std::vector<Vec3d> points;
  for (int i = 0; i <= kParts; ++i) {
    for (int j = 0; i + j <= kParts; ++j) {
      const Vec3d sum = to_double(corners[0]) * static_cast<double>(i) +
                        to_double(corners[1]) * static_cast<double>(j) +
                        to_double(corners[2]) * static_cast<double>(kParts - i - j);
      points.push_back(sum * (1.0 / kParts));
    }
  }
  return points;
}

bool holds(Vec3d lower, Vec3d upper, Vec3d p) {
  return lower.x <= p.x && p.x <= upper.x && lower.y <= p.y && p.y <= upper.y && lower.z <= p.z && p.z <= upper.z;
}

bool holds(const Box4& box, Vec3d p) {
  alignas(16) float lower[4], upper[4];
  box.lower.store(lower);
  box.upper.store(upper);
  return holds({lower[0], lower[1], lower[2]}, {upper[0], upper[1], upper[2]}, p);
}

// Returns the first triangle with a point that no leaf's box holds, or -1.
std::int64_t find_uncovered(const Bvh2& tree, const Mesh& mesh) {
  std::vector<std::vector<const Bvh2Node*>> leaves(mesh.primitive_count());
  for (const Bvh2Node& node : tree.nodes) {
    for (std::uint32_t i = 0; i < node.count; ++i) leaves[tree.prim_indices[node.first + i]].push_back(&node);
  }
  for (std::size_t triangle = 0; triangle < leaves.size(); ++triangle) {
    const TriangleIndices t = mesh.triangles[triangle];
    for (const Vec3d p : points_of({mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z]})) {
      const bool covered = std::any_of(leaves[triangle].begin(), leaves[triangle].end(), [&](const Bvh2Node* leaf) {
        return holds(to_double(leaf->lower), to_double(leaf->upper), p);
      });
      if (!covered) return static_cast<std::int64_t>(triangle);
    }
  }
  return -1;
}

// Slices ------------------------------------------------------------------------------------------------------------

TEST(SliceTriangle, CoversItsPoints) {
  for (const float scale : {1.0f, 0x1p-100f, 0x1p100f}) {
    MeshMaker maker(3);
    for (int trial = 0; trial < 3000; ++trial) {
      const float size = trial % 3 == 0 ? 1.0f : 0x1p-10f;
      const Vec3f at = maker.point(1.0f);
      const Vec3f corners[3] = {(at + maker.point(size)) * scale, (at + maker.point(1.0f)) * scale,
                                (at + maker.point(size)) * scale};
      const int axis = trial % 3;
      // Planes through corners too, where both slices must contain the corner.
      std::array<float, 4> planes{corners[0][axis], corners[1][axis], maker.number(1.0f) * scale, at[axis] * scale};
      std::sort(planes.begin(), planes.end());
      const auto count = static_cast<std::size_t>(std::unique(planes.begin(), planes.end()) - planes.begin());
      std::array<Box4, 5> slices;
      slice_triangle(corners[0], corners[1], corners[2], axis, {planes.data(), count}, slices.data());
      for (const Vec3d p : points_of(corners)) {
        for (std::size_t k = 0; k <= count; ++k) {
          if (k > 0 && p[axis] < static_cast<double>(planes[k - 1])) continue;
          if (k < count && p[axis] > static_cast<double>(planes[k])) continue;
          ASSERT_TRUE(holds(slices[k], p)) << "trial " << trial << " slice " << k << " scale " << scale;
        }
      }
    }
  }
}

TEST(SliceTriangle, IsTightAndKeepsFlatThingsFlat) {
  const float plane = 1.0f;
  std::array<Box4, 2> slices;
  slice_triangle({0, 0, 5}, {4, 0, 5}, {0, 4, 5}, 0, {&plane, 1}, slices.data());
  alignas(16) float upper[4], lower[4];
  slices[1].upper.store(upper);
  slices[1].lower.store(lower);
  EXPECT_EQ(upper[2], 5.0f);
  EXPECT_EQ(lower[2], 5.0f);
  EXPECT_EQ(upper[0], 4.0f);
  EXPECT_EQ(lower[1], 0.0f);
  EXPECT_NEAR(upper[1], 3.0f, 1e-5f);
  EXPECT_GE(upper[1], 3.0f);
  EXPECT_NEAR(lower[0], 1.0f, 1e-5f);
}

TEST(SliceTriangle, DoesNotOverflow) {
  const float most = 3e38f, plane = 1e38f;
  std::array<Box4, 2> slices;
  slice_triangle({-most, -most, -most}, {most, most, most}, {most, -most, 0}, 0, {&plane, 1}, slices.data());
  const double x = static_cast<double>(plane);
  EXPECT_TRUE(holds(slices[0], {x, x, x}) && holds(slices[1], {x, x, x}));
  EXPECT_FALSE(holds(slices[0], {2e38, 2e38, 2e38}));
}

// Trees -------------------------------------------------------------------------------------------------------------

TEST(Spatial, CoversEveryTriangle) {
  for (const float budget : {0.3f, 3.0f, 10.0f}) {
    const BuildConfig config = greedy(budget);
    for (const Mesh& mesh : {soup(800, 0.5f, 1), soup(800, 0.5f, 2, 0x1p-80f), soup(500, 2.0f, 3), slivers(800, 4),
                             slivers(500, 5, 0x1p50f), flat(800, 6), repeated_triangle(300)}) {
      const Bvh2 tree = build(mesh, config);
      EXPECT_EQ(fault_of(tree, mesh.primitive_count(), config), "");
      EXPECT_EQ(find_uncovered(tree, mesh), -1) << "budget " << budget;
      Aabb box;
      for (const Vec3f p : mesh.positions) box.grow(p);
      EXPECT_EQ(tree.bounds().lower, box.lower);  // t's error bounds depend on it, and must not depend on the builder
      EXPECT_EQ(tree.bounds().upper, box.upper);
    }
  }
}

// Enough triangles that planes are chosen from a sample of them.
TEST(Spatial, CoversEveryTriangleOfManyToo) {
  for (const Mesh& mesh : {soup(9000, 0.25f, 7), slivers(6000, 8)}) {
    const BuildConfig config = greedy(1.0f);
    const Bvh2 tree = build(mesh, config);
    EXPECT_EQ(fault_of(tree, mesh.primitive_count(), config), "");
    EXPECT_GT(tree.prim_indices.size(), mesh.primitive_count());
    EXPECT_EQ(find_uncovered(tree, mesh), -1);
  }
}

// Long parallel diagonals: their boxes fill nearly all of space, their slices do not.
Mesh sticks(std::size_t count) {
  MeshMaker maker(1);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f a = maker.point(1.0f), along{2.0f, 2.0f, i % 2 == 0 ? 2.0f : -2.0f};
    maker.add(a, a + along, a + maker.point(0x1p-8f));
  }
  return maker.take();
}

TEST(Spatial, CutsAndGains) {
  const Mesh mesh = sticks(3000);
  const Bvh2 cut = build(mesh, spatial(1.0f)), whole = build(mesh, BuildConfig{});
  EXPECT_GT(cut.prim_indices.size(), mesh.primitive_count() * 3 / 2);
  EXPECT_LT(measure_quality(cut).sah, 0.8 * measure_quality(whole).sah);
}

TEST(Spatial, CutsWithASmallBudgetToo) {
  const Mesh mesh = soup(3000, 0.0625f, 9);  // planes cross few of them
  const Bvh2 tree = build(mesh, spatial(0.05f));
  EXPECT_EQ(fault_of(tree, mesh.primitive_count(), spatial(0.05f)), "");
  EXPECT_GT(tree.prim_indices.size(), mesh.primitive_count());
}

TEST(Spatial, WithoutBudgetCutsNothing) {
  const Mesh mesh = soup(2000, 0.5f, 1);
  const Bvh2 tree = build(mesh, spatial(0.0f));
  EXPECT_EQ(fault_of(tree, mesh.primitive_count(), spatial(0.0f)), "");
  EXPECT_EQ(tree.prim_indices.size(), mesh.primitive_count());
}

TEST(Spatial, StaysSoundWhenOptimized) {
  BuildConfig config = greedy(1.0f);
  config.optimize_passes = 3;
  for (const Mesh& mesh : {slivers(2000, 1), soup(2000, 0.5f, 2)}) {
    const Bvh2 tree = build(mesh, config);
    EXPECT_FALSE(tree.refittable);
    EXPECT_EQ(find_fault(tree, mesh.primitive_count()), "");
    EXPECT_EQ(find_uncovered(tree, mesh), -1);
  }
}

TEST(Spatial, DigestsHardInput) {
  BuildConfig single = greedy(2.0f);
  single.max_leaf_size = 1;
  single.bins = 256;
  BuildConfig coarse = greedy(10.0f);
  coarse.bins = 2;
  for (const BuildConfig& config : {spatial(), greedy(1.0f), single, coarse}) {
    for (const NamedSet& set : hard_sets()) {
      if (config.bins != spatial().bins && set.refs.size() > 10000) continue;  // slow, and tests nothing more
      EXPECT_EQ(fault_of(build(set.refs, config), set.refs.size(), config), "") << set.name;
    }
  }
}

TEST(Spatial, GivesTheSameBytesForAnyThreadCount) {
  const Mesh mesh = slivers(12000, 1);
  for (const float budget : {0.3f, 2.0f}) {
    const Bvh2 alone = build(mesh, spatial(budget));
    for (const int thread_count : thread_counts()) {
      EXPECT_TRUE(same_bytes(alone, build(mesh, spatial(budget), thread_count))) << thread_count;
    }
  }
}

TEST(Spatial, StopsWhenAskedAndCountsItsWork) {
  const auto refs = sheet(150);
  for (const int thread_count : {1, 3}) {
    ThreadPool pool(thread_count);
    CancelToken stopped;
    stopped.request_stop();
    EXPECT_THROW((void)build_bvh2(refs, spatial(), pool, stopped), Cancelled);
    CancelToken cancel;
    cancel.expect(refs.size());
    (void)build_bvh2(refs, greedy(2.0f), pool, cancel);
    EXPECT_EQ(cancel.fraction(), 1.0f);
    cancel.expect(refs.size() + 1);
    (void)build_bvh2(refs, greedy(2.0f), pool, cancel);
    EXPECT_LT(cancel.fraction(), 1.0f) << "counted more than its primitives";
  }
}

TEST(Spatial, MakesNothingOfNothing) { EXPECT_TRUE(build(std::vector<PrimRef>{}, spatial()).empty()); }

}  // namespace
}  // namespace perfect_bvh::test
