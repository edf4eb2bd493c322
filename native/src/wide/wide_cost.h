// The expected cost of a wide tree for a ray, as a whole and for each of its parts. It is the surface area heuristic
// (MacDonald and Booth 1990), in a form that can be compared node by node with an earlier one, to see which parts
// motion has degraded.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "builders/quality.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/float4.h"
#include "mesh/mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// In visits to wide nodes. Collapsing minimizes the same costs.
inline constexpr double kWideNodeCost = 1.0, kWideLeafCost = 0.5;

[[nodiscard]] inline std::uint32_t child_count(const WideNode& node) noexcept {
  std::uint32_t count = 0;
  while (count < kWideWidth && node.child[count] != kNoChild) ++count;
  return count;
}

// Returns half the surface of each child; undefined for empty slots.
[[nodiscard]] inline std::array<float, kWideWidth> child_areas(const WideNode& node) noexcept {
  alignas(16) std::array<float, kWideWidth> areas;
  for (std::uint32_t first = 0; first < kWideWidth; first += 4) {
    const auto extent = [&](int axis) {
      return Float4::load(&node.planes[2 * axis + 1][first]) - Float4::load(&node.planes[2 * axis][first]);
    };
    const Float4 x = extent(0), y = extent(1), z = extent(2);
    (x * y + (y * z + z * x)).store(&areas[first]);
  }
  return areas;
}

// The expected visits of a random ray that hits a tree's box (SAH, without the costs).
struct TraceWork {
  double node_visits = 0;
  double leaf_visits = 0;
};

// Measures in one pass over the nodes. Zero if the box of the whole has no area, and for an empty tree.
[[nodiscard]] TraceWork measure_trace_work(const WideBvh& tree, const Mesh& mesh, CancelToken& cancel);

// Returns the expected cost of a random ray that hits a tree's box, 1 for each node and each triangle (SAH). One pass
// over the nodes and leaves. If the box of the whole has no area, returns the number of triangles; 0 for an empty tree.
[[nodiscard]] double measure_sah(const WideBvh& tree, const Mesh& mesh, CancelToken& cancel);

// Costs of a ray that hits a node's box: 1 for the node, plus each child's cost times its share of the node's surface.
// So neither size nor position matters. 0 if the node has no surface, as there is nothing to compare with.
struct WideCosts {
  AlignedVector<float> nodes;   // by row
  AlignedVector<float> leaves;  // the part of it that is for leaves

  [[nodiscard]] double of(std::uint32_t child) const noexcept {
    return child < kBlockChild ? static_cast<double>(nodes[child]) : kWideLeafCost;
  }
  [[nodiscard]] double of_leaves(std::uint32_t child) const noexcept {
    return child < kBlockChild ? static_cast<double>(leaves[child]) : kWideLeafCost;
  }
  [[nodiscard]] double whole(const WideBvh& tree) const noexcept { return tree.is_empty ? 0 : of(tree.root); }

  [[nodiscard]] std::size_t byte_count() const noexcept { return (nodes.size() + leaves.size()) * sizeof(float); }

  void resize(std::size_t node_count) { nodes.resize(node_count), leaves.resize(node_count); }
  // Sets the cost of a node with this half surface, whose children's costs are known.
  void set(std::uint32_t row, const WideNode& node, float area) noexcept {
    nodes[row] = leaves[row] = 0;
    if (!(area > 0)) return;
    const std::array<float, kWideWidth> areas = child_areas(node);
    double all = 0, for_leaves = 0;
    for (std::uint32_t lane = 0; lane < kWideWidth && node.child[lane] != kNoChild; ++lane) {
      all += static_cast<double>(areas[lane]) * of(node.child[lane]);
      for_leaves += static_cast<double>(areas[lane]) * of_leaves(node.child[lane]);
    }
    nodes[row] = static_cast<float>(kWideNodeCost + all / static_cast<double>(area));
    leaves[row] = static_cast<float>(for_leaves / static_cast<double>(area));
  }
};

// Measures a tree over triangles. The numbers do not depend on the number of threads.
[[nodiscard]] WideCosts measure_wide_costs(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel);

// Wide quality --------------------------------------------------------------------------------------------------------
// The quality of a wide tree.

// For trees that were not collapsed from binary ones. Visits count wide nodes, so they are fewer than a binary tree's.
// Leaves are leaf blocks. Sibling overlap is summed over every two children of a node, as a share of the nodes' area.
// bounds: of the tree, in its scale.
[[nodiscard]] TreeQuality measure_wide_quality(const WideBvh& tree, const Aabb& bounds);

}  // namespace perfect_bvh
