#include "wide/wide_quality.h"

#include <algorithm>

#include "wide/wide_boxes.h"

namespace perfect_bvh {
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

TreeQuality measure_wide_quality(const WideBvh& tree, const Mesh& mesh) {
  TreeQuality quality;
  if (tree.is_empty) return quality;
  const double root_area = half_area(bounds_of(tree, mesh));
  double node_area = tree.nodes.empty() ? 0 : root_area, test_area = 0, overlap = 0;
  const auto add_leaf = [&](std::uint32_t leaf, double area) {
    const std::uint32_t count = triangle_count_of(tree, leaf);
    test_area += area * count;
    quality.reference_count += count;
    quality.max_leaf_size = std::max(quality.max_leaf_size, count);
  };
  if (tree.nodes.empty()) add_leaf(tree.root - kBlockChild, root_area);
  for (const WideNode& node : tree.nodes) {
    overlap += overlap_of_children(node);
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      if (node.child[lane] == kNoChild) continue;
      const double area = half_area(child_box(node, lane));
      if (node.child[lane] < kBlockChild) {
        node_area += area;
      } else {
        add_leaf(node.child[lane] - kBlockChild, area);
      }
    }
  }
  quality.leaf_count = tree.leaf_count();
  quality.node_count = tree.nodes.size() + tree.leaf_count();
  quality.primitive_count = quality.reference_count;
  quality.depth = tree.depth;
  quality.is_refittable = !tree.repeats_triangles;
  quality.byte_count = tree.byte_count();
  quality.sibling_overlap = node_area > 0 ? overlap / node_area : 0;
  quality.node_visits = root_area > 0 ? node_area / root_area : 0;
  quality.primitive_tests = root_area > 0 ? test_area / root_area : static_cast<double>(quality.reference_count);
  quality.sah = quality.sah_at(1.0f, 1.0f);
  return quality;
}

}  // namespace perfect_bvh
