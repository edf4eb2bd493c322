#include "wide/collapse_plan.h"

#include <algorithm>
#include <limits>

namespace perfect_bvh {
namespace {

constexpr float kNever = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kLeafSize = 8;

bool contains(const std::array<std::uint32_t, 8>& values, std::uint32_t count, std::uint32_t value) noexcept {
  bool found = false;
  for (std::uint32_t i = 0; i < count; ++i) found |= values[i] == value;
  return found;
}

bool insert(std::array<std::uint32_t, 8>& values, std::uint32_t& count, std::uint32_t value) noexcept {
  if (contains(values, count, value)) return true;
  if (count == kLeafSize) return false;
  values[count++] = value;
  return true;
}

// What a planned subtree is to its parent. cost[k]: of giving it at most k places; cost[0] is unused.
struct Planned {
  std::array<float, 9> cost;
  bool fits = false;  // `set` is all of it
  LeafSet set;
};

bool collect_leaf(const Bvh2& tree, const Bvh2Node& node, const TriangleIndices* triangles, LeafSet& set) noexcept {
  if (triangles == nullptr) return node.count == 1;
  for (std::uint32_t i = 0; i < node.count; ++i) {
    const std::uint32_t primitive = tree.prim_indices[node.first + i];
    if (!set.add(primitive, triangles[primitive])) return false;
  }
  return true;
}

CollapseDecision plan_leaf(const Bvh2Node& node, float cost, Planned& planned) noexcept {
  planned.cost.fill(cost * node.box().half_area());
  CollapseDecision decision{};
  decision.is_leaf = 1;
  return decision;
}

// Combines the plans of both children (left in `planned`) into the node's own.
CollapseDecision plan_interior(const Bvh2Node& node, const Planned& right, const TriangleIndices* triangles,
                               const CollapseCosts& costs, Planned& planned) noexcept {
  std::array<float, 9> spread;
  std::array<std::uint8_t, 9> share{};
  for (std::uint32_t k = 2; k <= 8; ++k) {
    spread[k] = kNever;
    for (std::uint32_t left = 1; left < k; ++left) {
      const float cost = planned.cost[left] + right.cost[k - left];
      if (cost < spread[k] || share[k] == 0) spread[k] = cost, share[k] = static_cast<std::uint8_t>(left);
    }
  }
  planned.fits = triangles != nullptr && planned.fits && right.fits && planned.set.add(right.set);
  const float area = node.box().half_area();
  const float as_leaf = planned.fits ? costs.leaf * area : kNever;
  const float as_node = costs.node * area + spread[8];
  CollapseDecision decision{};
  decision.is_leaf = planned.fits && as_leaf <= as_node;
  decision.left_of_node = share[8] & 0x7F;
  planned.cost[1] = decision.is_leaf ? as_leaf : as_node;
  for (std::uint32_t k = 2; k <= 8; ++k) {
    const bool spreads = spread[k] < planned.cost[1];
    decision.share[k - 2] = spreads ? share[k] : std::uint8_t{0};
    planned.cost[k] = spreads ? spread[k] : planned.cost[1];
  }
  return decision;
}

}  // namespace

bool LeafSet::add(std::uint32_t primitive, const TriangleIndices& corners) noexcept {
  return insert(primitives, primitive_count, primitive) && insert(vertices, vertex_count, corners.x) &&
         insert(vertices, vertex_count, corners.y) && insert(vertices, vertex_count, corners.z);
}

bool LeafSet::add(const LeafSet& other) noexcept {
  for (std::uint32_t i = 0; i < other.vertex_count; ++i) {
    if (!insert(vertices, vertex_count, other.vertices[i])) return false;
  }
  for (std::uint32_t i = 0; i < other.primitive_count; ++i) {
    if (!insert(primitives, primitive_count, other.primitives[i])) return false;
  }
  return true;
}

std::vector<std::uint32_t> depth_first_order(const Bvh2& tree) {
  std::vector<std::uint32_t> order, waiting;
  if (tree.empty()) return order;
  order.reserve(tree.node_count());
  waiting.push_back(0);
  while (!waiting.empty()) {
    const std::uint32_t index = waiting.back();
    waiting.pop_back();
    order.push_back(index);
    if (tree.nodes[index].is_leaf()) continue;
    waiting.push_back(tree.nodes[index].first + 1);
    waiting.push_back(tree.nodes[index].first);
  }
  return order;
}

std::vector<CollapseDecision> plan_collapse(const Bvh2& tree, const TriangleIndices* triangles,
                                            const CollapseCosts& costs, CancelToken& cancel) {
  std::vector<CollapseDecision> decisions(tree.nodes.size());
  // Backwards through the depth-first order every node comes after its subtrees, the left one's plan on top.
  const std::vector<std::uint32_t> order = depth_first_order(tree);
  std::vector<Planned> finished;
  constexpr std::size_t kLook = 65536;
  for (std::size_t i = order.size(); i-- > 0;) {
    if (i % kLook == 0) cancel.throw_if_stopped();
    const Bvh2Node& node = tree.nodes[order[i]];
    if (node.is_leaf()) {
      Planned& planned = finished.emplace_back();
      planned.fits = collect_leaf(tree, node, triangles, planned.set);
      decisions[order[i]] = plan_leaf(node, costs.leaf, planned);
    } else {
      Planned& left = finished.back();
      Planned& right = finished[finished.size() - 2];
      decisions[order[i]] = plan_interior(node, right, triangles, costs, left);
      right = left;
      finished.pop_back();
    }
  }
  return decisions;
}

Bvh2 split_leaves(const Bvh2& tree, const TriangleIndices* triangles) {
  const auto fits = [&](const Bvh2Node& node) {
    LeafSet set;
    return collect_leaf(tree, node, triangles, set);
  };
  Bvh2 result;
  const bool all_fit = std::all_of(tree.nodes.begin(), tree.nodes.end(),
                                   [&](const Bvh2Node& node) { return !node.is_leaf() || fits(node); });
  if (all_fit) return result;
  result = tree;
  if (result.nodes.size() == 1) result.nodes.push_back({{}, 0, {}, 0});  // the root's sibling, unused
  for (std::size_t i = 0; i < result.nodes.size(); ++i) {
    const Bvh2Node leaf = result.nodes[i];
    if (!leaf.is_leaf() || fits(leaf)) continue;
    const auto first = static_cast<std::uint32_t>(result.nodes.size());
    const std::uint32_t half = leaf.count / 2;
    result.nodes.push_back({leaf.lower, leaf.first, leaf.upper, half});
    result.nodes.push_back({leaf.lower, leaf.first + half, leaf.upper, leaf.count - half});
    result.nodes[i].first = first;
    result.nodes[i].count = 0;
  }
  return result;
}

}  // namespace perfect_bvh
