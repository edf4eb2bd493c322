#include "builders/quality.h"

#include <algorithm>
#include <span>
#include <vector>

#include "core/steps.h"

namespace perfect_bvh {
namespace {

double half_area(const Bvh2Node& node) noexcept { return half_area(to_double(node.upper) - to_double(node.lower)); }

// 0 if the boxes do not meet.
double overlap(const Bvh2Node& a, const Bvh2Node& b) noexcept {
  const Vec3d e = to_double(min(a.upper, b.upper)) - to_double(max(a.lower, b.lower));
  return e.x < 0 || e.y < 0 || e.z < 0 ? 0 : half_area(e);
}

std::size_t count_distinct(std::span<const std::uint32_t> numbers, CancelToken& cancel) {
  std::uint32_t largest = 0;
  for_steps(numbers.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (const std::uint32_t number : numbers.subspan(begin, end - begin)) largest = std::max(largest, number);
  });
  std::vector<bool> is_seen(largest + std::size_t{1});
  std::size_t count = 0;
  for_steps(numbers.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (const std::uint32_t number : numbers.subspan(begin, end - begin)) {
      count += !is_seen[number];
      is_seen[number] = true;
    }
  });
  return count;
}

}  // namespace

TreeQuality measure_quality(const Bvh2& tree, CancelToken& cancel, float traversal_cost, float intersection_cost) {
  TreeQuality quality;
  if (tree.empty()) return quality;
  quality.node_count = tree.node_count();
  quality.depth = tree.depth;
  quality.is_refittable = tree.refittable;
  quality.byte_count = tree.byte_count();
  double leaf_area = 0, interior_area = 0, overlap_area = 0;
  const auto add = [&](std::size_t i) {
    const Bvh2Node& node = tree.nodes[i];
    if (node.is_leaf()) {
      ++quality.leaf_count;
      quality.reference_count += node.count;
      quality.max_leaf_size = std::max(quality.max_leaf_size, node.count);
      leaf_area += half_area(node) * node.count;
    } else if (i != 1) {
      interior_area += half_area(node);
      overlap_area += overlap(tree.nodes[node.first], tree.nodes[node.first + 1]);
    }
  };
  for_steps(tree.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) add(i);
  });
  quality.primitive_count = tree.refittable ? quality.reference_count : count_distinct(tree.prim_indices, cancel);
  quality.sibling_overlap = interior_area > 0 ? overlap_area / interior_area : 0;
  const double root_area = half_area(tree.nodes[0]);
  // A tree without area is hit by no random ray; its primitives stand in, as for any ray that does meet it.
  quality.node_visits = root_area > 0 ? interior_area / root_area : 0;
  quality.primitive_tests = root_area > 0 ? leaf_area / root_area : static_cast<double>(quality.reference_count);
  quality.sah = quality.sah_at(traversal_cost, intersection_cost);
  return quality;
}

}  // namespace perfect_bvh
