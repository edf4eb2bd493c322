#include "wide/wide_cost.h"

#include <algorithm>

#include "core/cancel.h"
#include "wide/bottom_up.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

TraceWork measure_trace_work(const WideBvh& tree, const Mesh& mesh, CancelToken& cancel) {
  if (tree.is_empty) return {};
  const double root_area = half_area(bounds_of(tree, mesh));
  if (!(root_area > 0)) return {};
  if (tree.nodes.empty()) return {0, 1};
  double node_area = root_area, leaf_area = 0;
  const auto add = [&](const WideNode& node) {
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      if (node.child[lane] == kNoChild) continue;
      (node.child[lane] < kBlockChild ? node_area : leaf_area) += half_area(child_box(node, lane));
    }
  };
  for_steps(tree.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) add(tree.nodes[i]);
  });
  return {node_area / root_area, leaf_area / root_area};
}

double measure_sah(const WideBvh& tree, const Mesh& mesh, CancelToken& cancel) {
  if (tree.is_empty) return 0;
  const double root_area = half_area(bounds_of(tree, mesh));
  if (tree.nodes.empty()) return triangle_count_of(tree, tree.root - kBlockChild);
  double area = root_area, triangle_count = 0;
  Steps steps(cancel);  // one a child: leaves are looked into
  for (const WideNode& node : tree.nodes) {
    for (std::uint32_t lane = 0; lane < kWideWidth && node.child[lane] != kNoChild; ++lane) {
      steps.step();
      const std::uint32_t child = node.child[lane];
      const double size = child < kBlockChild ? 0 : triangle_count_of(tree, child - kBlockChild);
      area += half_area(child_box(node, lane)) * (child < kBlockChild ? 1 : size);
      triangle_count += size;
    }
  }
  return root_area > 0 ? area / root_area : triangle_count;
}

WideCosts measure_wide_costs(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel) {
  WideCosts costs;
  costs.resize(tree.nodes.size());
  visit_bottom_up(tree, pool, cancel, [&](std::span<const std::uint32_t> rows) {
    for (std::size_t i = rows.size(); i-- > 0;) {
      const WideNode& node = tree.nodes[rows[i]];
      costs.set(rows[i], node, node_box(node).half_area());
    }
  });
  return costs;
}

// Wide quality --------------------------------------------------------------------------------------------------------

namespace {

double overlap_of_children(const WideNode& node) noexcept {
  double sum = 0;
  for (std::uint32_t a = 0; a < kWideWidth; ++a) {
    for (std::uint32_t b = 0; b < a; ++b) {
      sum += shared_half_area(child_box(node, a), child_box(node, b));
    }
  }
  return sum;
}

}  // namespace

TreeQuality measure_wide_quality(const WideBvh& tree, const Aabb& bounds) {
  TreeQuality quality;
  if (tree.is_empty) return quality;
  const double root_area = half_area(bounds);
  double node_area = tree.nodes.empty() ? 0 : root_area, test_area = 0, overlap = 0;
  const auto add_leaf = [&](std::uint32_t child, double area) {
    const std::uint32_t count = child < kInstanceChild ? triangle_count_of(tree, child - kBlockChild) : 1;
    ++quality.leaf_count;
    test_area += area * count;
    quality.reference_count += count;
    quality.max_leaf_size = std::max(quality.max_leaf_size, count);
  };
  if (tree.nodes.empty()) add_leaf(tree.root, root_area);
  for (const WideNode& node : tree.nodes) {
    overlap += overlap_of_children(node);
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      if (node.child[lane] == kNoChild) continue;
      const double area = half_area(child_box(node, lane));
      if (node.child[lane] < kBlockChild) {
        node_area += area;
      } else {
        add_leaf(node.child[lane], area);
      }
    }
  }
  quality.node_count = tree.nodes.size() + quality.leaf_count;
  quality.primitive_count = quality.reference_count;
  quality.depth = tree.depth;
  quality.is_refittable = !tree.repeats_triangles;
  quality.sibling_overlap = node_area > 0 ? overlap / node_area : 0;
  quality.node_visits = root_area > 0 ? node_area / root_area : 0;
  quality.primitive_tests = root_area > 0 ? test_area / root_area : static_cast<double>(quality.reference_count);
  quality.sah = quality.node_visits + quality.primitive_tests;
  return quality;
}

}  // namespace perfect_bvh
