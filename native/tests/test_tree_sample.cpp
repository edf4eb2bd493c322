// Predicts the cost of a fresh tree from a few of its triangles.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/mesh_sets.h"
#include "tests/wide_trees.h"
#include "update/mesh_shape.h"
#include "wide/wide_cost.h"

namespace perfect_bvh::test {
namespace {

void shear(Positions& positions, float amount) {
  for (Vec3f& p : positions) p = p + Vec3f{amount * p.y, 0.0f, 0.3f * amount * p.y};
}

double cost_of(const Mesh& mesh) {
  ThreadPool pool(1);
  CancelToken cancel;
  const WideBvh tree = build(mesh, {"auto", {}});
  return measure_wide_costs(tree, pool, cancel).whole(tree);
}

TEST(TreeSample, ChangesAsTheCostOfATreeDoes) {
  ThreadPool pool(1);
  const std::vector<Motion> changes{{"twist", [](Positions& p) { twist(p, 6.2831853f); }},
                                    {"far twist", [](Positions& p) { twist(p, 25.0f); }},
                                    {"shear", [](Positions& p) { shear(p, 3.0f); }},
                                    {"far shear", [](Positions& p) { shear(p, 30.0f); }},
                                    {"larger", [](Positions& p) { scale(p, 1000.0f); }}};
  Mesh sheet = bumpy_sheet(100);
  for (Vec3f& p : sheet.positions) p.z *= 4.0f;
  for (const Mesh& still : {sheet, triangle_soup(10000, 0.02f)}) {
    const double sample = measure_tree_sample(still, pool), cost = cost_of(still);
    for (const Motion& change : changes) {
      const Mesh mesh = moved(still, change);
      const double foretold = measure_tree_sample(mesh, pool) / sample, true_change = cost_of(mesh) / cost;
      EXPECT_LT(std::abs(std::log(foretold / true_change)), 0.4)
          << change.name << " " << foretold << " " << true_change;
    }
  }
}

TEST(TreeSample, IsTheSameForAnyThreadCountAndKnowsNothingOfWhatHasNoExtent) {
  ThreadPool one(1), four(4);
  const Mesh soup = triangle_soup(50000, 0.1f);
  EXPECT_EQ(measure_tree_sample(soup, one), measure_tree_sample(soup, four));
  EXPECT_EQ(measure_tree_sample({}, one), 0);
  for (const NamedMesh& mesh : hard_meshes()) {
    const double cost = measure_tree_sample(mesh.mesh, one);
    EXPECT_TRUE(std::isfinite(cost) && cost >= 0) << mesh.name;
  }
}

}  // namespace
}  // namespace perfect_bvh::test
