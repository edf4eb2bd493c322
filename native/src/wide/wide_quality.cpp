#include "wide/wide_quality.h"

#include <algorithm>
#include <vector>

#include "wide/wide_boxes.h"

namespace perfect_bvh {
namespace {

double half_area(const Aabb& box) noexcept {
  const Vec3d e = to_double(box.upper) - to_double(box.lower);
  return box.is_empty() ? 0 : e.x * e.y + e.y * e.z + e.z * e.x;
}

double overlap_of_children(const WideNode& node) noexcept {
  double sum = 0;
  for (std::uint32_t a = 0; a < kWideWidth; ++a) {
    for (std::uint32_t b = 0; b < a; ++b) {
      const Aabb first = child_box(node, a), second = child_box(node, b);
      sum += half_area({max(first.lower, second.lower), min(first.upper, second.upper)});
    }
  }
  return sum;
}

std::string at(const char* what, const char* where, std::uint32_t row) {
  return std::string(where) + " " + std::to_string(row) + ": " + what;
}

// Walks a tree of which nothing is taken for granted.
class WideValidator {
 public:
  WideValidator(const WideBvh& tree, const TriangleMesh& mesh)
      : tree_(tree),
        mesh_(mesh),
        node_is_seen_(tree.nodes.size(), false),
        leaf_is_seen_(tree.leaf_count(), false),
        references_(mesh.triangle_count(), 0) {}

  std::string find_fault(bool once) {
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
    for (std::uint32_t lane = 0; lane < 8; ++lane) {
      const std::uint32_t primitive = primitives[lane];
      if (primitive >= references_.size()) return at("refers to no triangle", "leaf", row);
      if (lane > 0 && primitive < primitives[lane - 1]) return at("triangles out of order", "leaf", row);
      if (lane == 0 || primitive != primitives[lane - 1]) ++references_[primitive];
      if (!holds_corners(row, lane, entry.box)) return at("a vertex that is not the triangle's", "leaf", row);
    }
    return "";
  }

  // A clipped box holds a part of the triangle only: then some of the corners lie outside.
  [[nodiscard]] bool holds_corners(std::uint32_t leaf, std::uint32_t lane, const Aabb& box) {
    const TriangleIndices corners = mesh_.triangles[primitives_of(tree_, leaf)[lane]];
    const std::uint32_t vertices[3] = {corners.x, corners.y, corners.z};
    for (std::uint32_t corner = 0; corner < 3; ++corner) {
      const Vec3f vertex = mesh_.positions[vertices[corner]] * tree_.scale;
      if (tree_.layout == TreeLayout::kDefault && !(stored_corner(leaf, lane, corner) == vertex)) return false;
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
  const TriangleMesh& mesh_;
  std::vector<bool> node_is_seen_, leaf_is_seen_;
  std::vector<std::uint32_t> references_;  // of each triangle
  std::vector<Entry> waiting_;
  std::uint32_t deepest_ = 0;
  bool has_corner_outside_ = false;
};

}  // namespace

TreeQuality measure_wide_quality(const WideBvh& tree, const TriangleMesh& mesh) {
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

std::string find_wide_fault(const WideBvh& tree, const TriangleMesh& mesh, bool once) {
  return WideValidator(tree, mesh).find_fault(once);
}

}  // namespace perfect_bvh
