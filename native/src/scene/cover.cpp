#include "scene/cover.h"

#include <algorithm>

namespace perfect_bvh {

std::vector<Aabb> cover_boxes(const Bvh2& tree, std::size_t limit) {
  if (tree.empty()) return {};
  // The node with the largest surface gains most from being opened. Ties go by index, so that the cover repeats.
  struct Candidate {
    float area;
    std::uint32_t node;
    bool operator<(const Candidate& other) const { return area != other.area ? area < other.area : node > other.node; }
  };
  std::vector<Aabb> boxes;
  std::vector<Candidate> open{{tree.nodes[0].box().half_area(), 0}};
  while (!open.empty()) {
    std::pop_heap(open.begin(), open.end());
    const Bvh2Node& node = tree.nodes[open.back().node];
    open.pop_back();
    if (node.is_leaf() || boxes.size() + open.size() + 2 > limit) {
      boxes.push_back(node.box());
      continue;
    }
    for (const std::uint32_t child : {node.first, node.first + 1}) {
      open.push_back({tree.nodes[child].box().half_area(), child});
      std::push_heap(open.begin(), open.end());
    }
  }
  return boxes;
}

}  // namespace perfect_bvh
