#include "wide/wide_cost.h"

#include "core/steps.h"
#include "wide/bottom_up.h"
#include "wide/wide_boxes.h"

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

}  // namespace perfect_bvh
