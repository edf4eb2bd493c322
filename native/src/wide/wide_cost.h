// What a wide tree is expected to cost a ray, whole and in each of its parts: the surface area heuristic (MacDonald and
// Booth 1990) in a form that is compared node by node with an earlier one, to see which parts motion has degraded.
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

// In visits to wide nodes; the costs that trees are collapsed by.
inline constexpr double kWideNodeCost = 1.0, kWideLeafCost = 0.5;

[[nodiscard]] inline std::uint32_t child_count(const WideNode& node) noexcept {
  std::uint32_t count = 0;
  while (count < kWideWidth && node.child[count] != kNoChild) ++count;
  return count;
}

// Half the surfaces of the children; without meaning for empty places.
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

// What a random ray that meets a tree's box is expected to visit (SAH, without the costs).
struct TraceWork {
  double node_visits = 0;
  double leaf_visits = 0;
};

// One pass over the nodes. Zero where the box of the whole has no area, and for an empty tree.
[[nodiscard]] TraceWork measure_trace_work(const WideBvh& tree, const Mesh& mesh, CancelToken& cancel);

// What a random ray that meets a tree's box is expected to spend, 1 for each node and each triangle (SAH). One pass
// over the nodes and leaves. Where the box of the whole has no area, the triangles stand in; 0 for an empty tree.
[[nodiscard]] double measure_sah(const WideBvh& tree, const Mesh& mesh, CancelToken& cancel);

// Of a ray that meets a node's box: 1 for the node, and for each child its own cost times its share of the node's
// surface. So neither size nor place matters. 0 where the node has no surface: there is nothing to compare with.
struct WideCosts {
  AlignedVector<float> nodes;   // by row
  AlignedVector<float> leaves;  // what of it is for leaves

  [[nodiscard]] double of(std::uint32_t child) const noexcept {
    return child < kBlockChild ? static_cast<double>(nodes[child]) : kWideLeafCost;
  }
  [[nodiscard]] double of_leaves(std::uint32_t child) const noexcept {
    return child < kBlockChild ? static_cast<double>(leaves[child]) : kWideLeafCost;
  }
  [[nodiscard]] double whole(const WideBvh& tree) const noexcept { return tree.is_empty ? 0 : of(tree.root); }

  [[nodiscard]] std::size_t byte_count() const noexcept { return (nodes.size() + leaves.size()) * sizeof(float); }

  void resize(std::size_t node_count) { nodes.resize(node_count), leaves.resize(node_count); }
  // Of a node with this half surface whose children's costs are known.
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

// Of a tree over triangles. The same numbers for any number of threads.
[[nodiscard]] WideCosts measure_wide_costs(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel);

// Wide quality --------------------------------------------------------------------------------------------------------
// How good a wide tree over triangles is.

// For trees that were never binary ones: visits are those of wide nodes, so they are fewer than a binary tree's. Leaves
// are leaf blocks; sibling overlap is that of every two children of a node, as a share of the nodes' area.
[[nodiscard]] TreeQuality measure_wide_quality(const WideBvh& tree, const Mesh& mesh);

}  // namespace perfect_bvh
