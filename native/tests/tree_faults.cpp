#include "tests/tree_faults.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "wide/wide_bvh.h"

namespace perfect_bvh::test {
namespace {

std::string at(const char* what, std::size_t node) { return "node " + std::to_string(node) + ": " + what; }

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

std::string at(const char* what, const char* where, std::uint32_t row) {
  return std::string(where) + " " + std::to_string(row) + ": " + what;
}

class WideValidator {
 public:
  WideValidator(const WideBvh& tree, const Mesh& mesh)
      : tree_(tree),
        mesh_(mesh),
        node_is_seen_(tree.nodes.size(), false),
        leaf_is_seen_(tree.leaf_count(), false),
        references_(mesh.primitive_count(), 0) {}

  std::string find_fault(bool once) {
    if (mesh_.is_round() && !tree_.blocks.empty()) return "a leaf of vertices over curves or points";
    if (tree_.is_empty) return references_.empty() ? "" : "the tree is empty but there are triangles";
    waiting_.push_back({tree_.root, bounds_of(tree_, mesh_), 1});
    while (!waiting_.empty()) {
      const Entry entry = waiting_.back();
      waiting_.pop_back();
      const std::string fault = entry.child >= kBlockChild ? visit_leaf(entry) : visit_node(entry);
      if (!fault.empty()) return fault;
    }
    return check_totals(once);
  }

 private:
  struct Entry {
    std::uint32_t child;
    Aabb box;
    std::uint32_t depth;
  };

  std::string visit_node(const Entry& entry) {
    const std::uint32_t row = entry.child;
    if (row >= tree_.nodes.size()) return at("past the array", "node", row);
    if (node_is_seen_[row]) return at("reached twice", "node", row);
    node_is_seen_[row] = true;
    deepest_ = std::max(deepest_, entry.depth);
    const WideNode& node = tree_.nodes[row];
    for (std::uint32_t octant = 0; octant < 8; ++octant) {
      std::uint32_t lanes = 0;
      for (const std::uint32_t order : node.order) lanes |= 1u << ((order >> (3 * octant)) & 7u);
      if (lanes != 0xFFu) return at("an order that is no permutation", "node", row);
    }
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      const Aabb box = child_box(node, lane);
      const bool is_taken = node.child[lane] != kNoChild;
      if (is_taken == box.is_empty()) return at("a box without a child, or a child without", "node", row);
      if (!entry.box.contains(box)) return at("does not contain its child", "node", row);
      if (is_taken) waiting_.push_back({node.child[lane], box, entry.depth + 1});
    }
    return "";
  }

  std::string visit_leaf(const Entry& entry) {
    const std::uint32_t row = entry.child - kBlockChild;
    if (row >= tree_.leaf_count()) return at("past the array", "leaf", row);
    if (leaf_is_seen_[row]) return at("reached twice", "leaf", row);
    leaf_is_seen_[row] = true;
    const std::uint32_t* const primitives = primitives_of(tree_, row);
    if (!tree_.curve_leaves.empty() && tree_.curve_leaves[row].lanes != (1u << triangle_count_of(tree_, row)) - 1)
      return at("lanes that are not those of its segments", "leaf", row);
    for (std::uint32_t lane = 0; lane < 8; ++lane) {
      const std::uint32_t primitive = primitives[lane];
      if (primitive >= references_.size()) return at("refers to no triangle", "leaf", row);
      if (lane > 0 && primitive < primitives[lane - 1]) return at("triangles out of order", "leaf", row);
      if (lane == 0 || primitive != primitives[lane - 1]) ++references_[primitive];
      has_corner_outside_ |= mesh_.is_round() && !entry.box.contains(scaled_box(primitive));
      if (!tree_.curve_leaves.empty() && !is_within_capsule(tree_.curve_leaves[row], lane))
        return at("a capsule that does not hold its segment", "leaf", row);
      if (!mesh_.is_round() && !holds_corners(row, lane, entry.box))
        return at("a vertex that is not the triangle's", "leaf", row);
    }
    return "";
  }

  [[nodiscard]] Aabb scaled_box(std::uint32_t primitive) const noexcept {
    const Aabb box = mesh_.primitive_box(primitive);
    return {box.lower * tree_.scale, box.upper * tree_.scale};
  }

  // A leaf of curves: both spheres must be inside those of the capsule's ends.
  [[nodiscard]] bool is_within_capsule(const CurveLeaf& leaf, std::uint32_t lane) const {
    if (lane > 0 && (leaf.lanes >> lane & 1) != 0 && leaf.primitives[lane] == leaf.primitives[lane - 1]) return false;
    const Ball* const balls = &mesh_.balls[mesh_.segments[leaf.primitives[lane]] & kSegmentBall];
    const auto is_within = [&](const Ball& ball, std::uint32_t word) {
      double squared = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double stored = (word >> (10 * axis)) & 1023u;
        const double exact =
            (static_cast<double>(ball.centre[axis] * tree_.scale) - static_cast<double>(leaf.corner.at[axis])) *
            static_cast<double>(leaf.corner.steps);
        squared += (stored - exact) * (stored - exact);
      }
      const double radius = static_cast<double>(ball.radius * tree_.scale) * static_cast<double>(leaf.corner.steps);
      return std::sqrt(squared) + radius <= leaf.radii[lane];
    };
    return is_within(balls[0], leaf.first[lane]) && is_within(balls[1], leaf.last[lane]);
  }

  // A clipped box holds only a part of the triangle, so some corners may be outside.
  [[nodiscard]] bool holds_corners(std::uint32_t leaf, std::uint32_t lane, const Aabb& box) {
    const TriangleIndices corners = mesh_.triangles[primitives_of(tree_, leaf)[lane]];
    const std::uint32_t vertices[3] = {corners.x, corners.y, corners.z};
    for (std::uint32_t corner = 0; corner < 3; ++corner) {
      const Vec3f vertex = mesh_.positions[vertices[corner]] * tree_.scale;
      if (!(stored_corner(leaf, lane, corner) == vertex)) return false;
      has_corner_outside_ |= !box.contains({vertex, vertex});
    }
    return true;
  }

  [[nodiscard]] Vec3f stored_corner(std::uint32_t leaf, std::uint32_t lane, std::uint32_t corner) const {
    const LeafBlock& block = tree_.blocks[leaf];
    const std::uint32_t place = (block.corners[lane] >> (4 * corner)) & 7u;
    return {block.vertices[0][place], block.vertices[1][place], block.vertices[2][place]};
  }

  std::string check_totals(bool once) const {
    if (once && has_corner_outside_) return "a leaf's box does not contain its triangles";
    for (std::size_t i = 0; i < references_.size(); ++i) {
      if (references_[i] == 0) return "triangle " + std::to_string(i) + " is in no leaf";
      if (once && references_[i] > 1) return "triangle " + std::to_string(i) + " is in two leaves";
    }
    if (std::find(node_is_seen_.begin(), node_is_seen_.end(), false) != node_is_seen_.end()) return "a lost node";
    if (std::find(leaf_is_seen_.begin(), leaf_is_seen_.end(), false) != leaf_is_seen_.end()) return "a lost leaf";
    return deepest_ == tree_.depth ? "" : "depth is " + std::to_string(deepest_) + ", not as stored";
  }

  const WideBvh& tree_;
  const Mesh& mesh_;
  std::vector<bool> node_is_seen_, leaf_is_seen_;
  std::vector<std::uint32_t> references_;  // of each triangle
  std::vector<Entry> waiting_;
  std::uint32_t deepest_ = 0;
  bool has_corner_outside_ = false;
};

}  // namespace

std::string find_fault(const Bvh2& tree, std::size_t primitive_count) {
  return Validator(tree, primitive_count).find_fault();
}

std::string find_wide_fault(const WideBvh& tree, const Mesh& mesh, bool once) {
  return WideValidator(tree, mesh).find_fault(once);
}

}  // namespace perfect_bvh::test
