#include "builders/quality.h"

#include <algorithm>
#include <span>
#include <vector>

namespace perfect_bvh {
namespace {

// In double, so that neither large nor many small boxes lose their share.
double half_area(Vec3d e) noexcept { return e.x * e.y + e.y * e.z + e.z * e.x; }
double half_area(const Bvh2Node& node) noexcept { return half_area(to_double(node.upper) - to_double(node.lower)); }

// 0 if the boxes do not meet.
double overlap(const Bvh2Node& a, const Bvh2Node& b) noexcept {
  const Vec3d e = to_double(min(a.upper, b.upper)) - to_double(max(a.lower, b.lower));
  return e.x < 0 || e.y < 0 || e.z < 0 ? 0 : half_area(e);
}

std::size_t count_distinct(std::span<const std::uint32_t> numbers) {
  std::vector<bool> is_seen(numbers.empty() ? 0 : *std::max_element(numbers.begin(), numbers.end()) + std::size_t{1});
  std::size_t count = 0;
  for (const std::uint32_t number : numbers) {
    count += !is_seen[number];
    is_seen[number] = true;
  }
  return count;
}

std::string at(const char* what, std::size_t node) { return "node " + std::to_string(node) + ": " + what; }

// Walks a tree of which nothing is taken for granted.
class Validator {
 public:
  Validator(const Bvh2& tree, std::size_t primitive_count)
      : tree_(tree), visited_(tree.nodes.size(), false), references_(primitive_count, 0) {}

  std::string find_fault() {
    if (tree_.nodes.empty()) return references_.empty() ? "" : "the tree is empty but there are primitives";
    if (references_.empty()) return "there are nodes but no primitives";
    std::vector<Entry> stack{{0, 0}};
    visited_[0] = true;
    while (!stack.empty()) {
      const Entry entry = stack.back();
      stack.pop_back();
      deepest_ = std::max(deepest_, entry.depth);
      const Bvh2Node& node = tree_.nodes[entry.index];
      std::string fault = !node.box().is_empty() ? "" : at("an empty or NaN box", entry.index);
      if (fault.empty()) fault = node.is_leaf() ? visit_leaf(entry.index) : visit_interior(entry, stack);
      if (!fault.empty()) return fault;
    }
    return check_totals();
  }

 private:
  struct Entry {
    std::size_t index;
    std::uint32_t depth;
  };

  std::string visit_leaf(std::size_t index) {
    const Bvh2Node& node = tree_.nodes[index];
    if (std::size_t{node.first} + node.count > tree_.prim_indices.size()) return at("rows past prim_indices", index);
    for (std::uint32_t i = 0; i < node.count; ++i) {
      const std::uint32_t prim = tree_.prim_indices[node.first + i];
      if (prim >= references_.size()) return at("refers to no primitive", index);
      ++references_[prim];
    }
    return "";
  }

  std::string visit_interior(const Entry& entry, std::vector<Entry>& stack) {
    const std::size_t index = entry.index;
    const Bvh2Node& node = tree_.nodes[index];
    if (node.first % 2 != 0 || node.first < 2) return at("children not at an even index from 2 on", index);
    if (node.first <= index) return at("stands after its children", index);
    if (std::size_t{node.first} + 1 >= tree_.nodes.size()) return at("children past the array", index);
    for (const std::size_t child : {std::size_t{node.first}, std::size_t{node.first} + 1}) {
      if (visited_[child]) return at("reached twice", child);
      visited_[child] = true;
      if (!node.box().contains(tree_.nodes[child].box())) return at("does not contain its child", index);
      stack.push_back({child, entry.depth + 1});
    }
    return "";
  }

  std::string check_totals() const {
    for (std::size_t prim = 0; prim < references_.size(); ++prim) {
      if (references_[prim] == 0) return "primitive " + std::to_string(prim) + " is in no leaf";
      if (references_[prim] > 1 && tree_.refittable) return "primitive " + std::to_string(prim) + " is in two leaves";
    }
    for (std::size_t index = 0; index < visited_.size(); ++index) {
      if (!visited_[index] && index != 1) return at("not reachable", index);
    }
    if (tree_.nodes.size() == 2) return "a single leaf needs no padding";
    if (deepest_ != tree_.depth) {
      return "depth is " + std::to_string(deepest_) + " but stored as " + std::to_string(tree_.depth);
    }
    if (deepest_ > kMaxTreeDepth) return "deeper than kMaxTreeDepth: " + std::to_string(deepest_);
    return "";
  }

  const Bvh2& tree_;
  std::vector<bool> visited_;
  std::vector<std::uint32_t> references_;  // of each primitive
  std::uint32_t deepest_ = 0;
};

}  // namespace

TreeQuality measure_quality(const Bvh2& tree, float traversal_cost, float intersection_cost) {
  TreeQuality quality;
  if (tree.empty()) return quality;
  quality.node_count = tree.node_count();
  quality.depth = tree.depth;
  quality.is_refittable = tree.refittable;
  quality.byte_count = tree.byte_count();
  double leaf_area = 0, interior_area = 0, overlap_area = 0;
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
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
  }
  quality.primitive_count = tree.refittable ? quality.reference_count : count_distinct(tree.prim_indices);
  quality.sibling_overlap = interior_area > 0 ? overlap_area / interior_area : 0;
  const double root_area = half_area(tree.nodes[0]);
  // A tree without area is hit by no random ray; its primitives stand in, as for any ray that does meet it.
  quality.node_visits = root_area > 0 ? interior_area / root_area : 0;
  quality.primitive_tests = root_area > 0 ? leaf_area / root_area : static_cast<double>(quality.reference_count);
  quality.sah = quality.sah_at(traversal_cost, intersection_cost);
  return quality;
}

std::string find_fault(const Bvh2& tree, std::size_t primitive_count) {
  return Validator(tree, primitive_count).find_fault();
}

}  // namespace perfect_bvh
