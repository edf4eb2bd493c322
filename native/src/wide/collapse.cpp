#include "wide/collapse.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <type_traits>
#include <vector>

#include "core/cancel.h"
#include "core/errors.h"
#include "math/float4.h"
#include "wide/leaf_block.h"
#include "wide/small_set.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

// `scale`: 0 to derive it from the boxes.
WideBvh collapse(const Bvh2& given, const Mesh* mesh, float scale, ThreadPool& pool, CancelToken& cancel) {
  WideBvh wide;
  if (given.empty()) return wide;
  const LeafRoom room = mesh ? LeafRoom(*mesh) : LeafRoom();
  const Bvh2 split = split_leaves(given, room, pool, cancel);
  const Bvh2& tree = split.empty() ? given : split;
  const Aabb bounds = tree.bounds();
  wide.is_empty = false;
  wide.repeats_triangles =
      mesh != nullptr && (!given.refittable || given.prim_indices.size() > mesh->primitive_count());
  CollapseCosts costs;
  costs.scale = tree_scale(bounds);
  wide.scale = scale > 0 ? scale : costs.scale;
  wide.extent = tree_extent(bounds, wide.scale);
  // Measured on three meshes: 3 to 11% fewer nodes, at equal visits. In a tree of few nodes, each node is hit by many
  // rays.
  constexpr float kMemory = 10.0f;
  if (mesh != nullptr) costs.memory = std::min(kMemory, static_cast<float>(tree.prim_indices.size()) / 64.0f);
  const auto decisions = plan_collapse(tree, room, costs, pool, cancel);
  emit_wide(tree, mesh, decisions, wide, pool, cancel);
  return wide;
}

}  // namespace

WideBvh collapse_mesh(const Bvh2& tree, const Mesh& mesh, ThreadPool& pool, CancelToken& cancel) {
  return collapse(tree, &mesh, 0, pool, cancel);
}

WideBvh collapse_top_level(const Bvh2& tree, ThreadPool& pool, CancelToken& cancel) {
  return collapse(tree, nullptr, 0, pool, cancel);
}

AlignedVector<WideNode> collapse_over_leaves(const Bvh2& tree, ThreadPool& pool, CancelToken& cancel) {
  WideBvh wide = collapse(tree, nullptr, 1.0f, pool, cancel);
  for_steps(wide.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      for (std::uint32_t& child : wide.nodes[i].child) {
        child -= child >= kInstanceChild ? kInstanceChild - kBlockChild : 0;
      }
    }
  });
  return std::move(wide.nodes);
}

// Collapse plan -------------------------------------------------------------------------------------------------------
// Chooses which nodes of a binary tree become the children of each wide node, and which subtrees become leaves. The
// choice has the least expected cost (optimal collapse by dynamic programming, after Wald, Benthin and Boulos 2008 and
// Ylitie, Karras and Laine 2017).
// In: a binary tree, and the capacity of a leaf. Out: a decision for every node, from which the wide tree is emitted.

namespace {

[[nodiscard]] float area_of(const Bvh2Node& node, const CollapseCosts& costs) noexcept {
  return Aabb{node.lower * costs.scale, node.upper * costs.scale}.half_area();
}

constexpr float kNever = std::numeric_limits<float>::infinity();

// The contents of a subtree if it becomes one leaf.
struct LeafContents {
  bool fits = false;
  std::uint32_t reference_count = 0;
  SmallSet vertices;
  SmallSet primitives;  // where a primitive may be referred to twice (spatial splits)
};

// Used if no leaves can be joined (a top level, or leaves that are full already): the contents are not needed.
struct NoContents {};

// A planned node as its parent sees it: the least cost of giving it at most 1, 2 ... 8 slots. Infinite costs precede
// them, so that costs can be read from up to 6 entries before.
template <class Contents>
struct alignas(16) Planned {
  static constexpr std::size_t kOne = 11;
  std::array<float, kOne + 9> costs;
  bool is_leaf = false;  // of the binary tree: more slots do not make it cheaper
  Contents contents;

  [[nodiscard]] float cost(std::size_t places) const noexcept { return costs[kOne - 1 + places]; }
  void set_costs(float one, Float4 two_to_five, Float4 six_to_nine) noexcept {
    Float4(kNever).store(&costs[kOne - 7]);
    Float4(kNever).store(&costs[kOne - 3]);
    costs[kOne] = one;
    two_to_five.store(&costs[kOne + 1]);
    six_to_nine.store(&costs[kOne + 5]);
  }
};

// Both children of a node: the least cost of giving them 2, 3 ... 9 slots, and the number that the left one gets.
template <class Contents>
struct PlannedPair {
  std::uint32_t pair;  // the left child
  Float4 costs[2];
  Float4 left_shares[2];
  Contents contents;
};

// Pairs wait on a stack. In reverse depth-first order, a node's children are on top when the node is planned.
// Contents: LeafContents or NoContents.
template <class Contents>
class Planner {
 public:
  using Node = Planned<Contents>;
  using Pair = PlannedPair<Contents>;

  Planner(const Bvh2& tree, const LeafRoom& room, const CollapseCosts& costs, CollapseDecision* decisions)
      : tree_(tree),
        limits_vertices_(room.triangles != nullptr),
        triangles_(room.triangles),
        costs_(costs),
        memory_cost_(costs.memory * area_of(tree.nodes[0], costs) / static_cast<float>(tree.prim_indices.size())),
        decisions_(decisions) {}

  void push(const Pair& pair) { waiting_.push_back(pair); }
  [[nodiscard]] Pair pop(std::uint32_t expected) {
    if (waiting_.empty() || waiting_.back().pair != expected) {
      throw EngineError("collapse: the binary tree is not in depth-first order");
    }
    const Pair top = waiting_.back();
    waiting_.pop_back();
    return top;
  }

  // Plans the pairs in [begin, end), which are below one node.
  [[nodiscard]] Pair plan_below(std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t pair = end; pair > begin;) plan_pair(pair -= 2);
    return pop(begin);
  }

  void plan_pair(std::uint32_t pair) {
    Node left, right;
    plan_node(pair, left);
    plan_node(pair + 1, right);
    Pair& both = waiting_.emplace_back();
    both.pair = pair;
    share_places(left, right, both);
    if constexpr (kJoinsLeaves) join(left.contents, right.contents, both.contents);
  }

  void plan_node(std::uint32_t index, Node& planned) {
    const Bvh2Node& node = tree_.nodes[index];
    const float area = area_of(node, costs_);
    CollapseDecision& decision = decisions_[index];
    decision = {};
    if (node.is_leaf()) {
      decision.is_leaf = 1;
      const Float4 all(costs_.leaf * area);
      planned.set_costs(costs_.leaf * area, all, all);
      planned.is_leaf = true;
      if constexpr (kJoinsLeaves) collect_leaf(node, planned.contents);
      return;
    }
    const Pair below = pop(node.first);
    planned.contents = below.contents;
    alignas(16) std::array<float, 8> spread, shares;
    below.costs[0].store(&spread[0]), below.costs[1].store(&spread[4]);
    below.left_shares[0].store(&shares[0]), below.left_shares[1].store(&shares[4]);
    float one = costs_.node * area + memory_cost_ + spread[6];
    if constexpr (kJoinsLeaves) {
      decision.is_leaf = below.contents.fits && costs_.leaf * area <= one;
      if (decision.is_leaf) one = costs_.leaf * area;
    }
    for (std::size_t k = 0; k < 7; ++k) decision.share[k] = spread[k] < one ? static_cast<std::uint8_t>(shares[k]) : 0;
    decision.left_of_node = static_cast<std::uint8_t>(shares[6]) & 0x7F;
    planned.set_costs(one, min(below.costs[0], Float4(one)), min(below.costs[1], Float4(one)));
  }

 private:
  static constexpr bool kJoinsLeaves = std::is_same_v<Contents, LeafContents>;

  static void share_places(const Node& left, const Node& right, Pair& both) noexcept {
    const float* const of_right = &right.costs[Node::kOne];
    Float4 cost[2], share[2] = {Float4(1.0f), Float4(1.0f)};
    cost[0] = Float4(left.cost(1)) + Float4::load_unaligned(of_right);
    cost[1] = Float4(left.cost(1)) + Float4::load_unaligned(of_right + 4);
    for (std::size_t to_left = 2; to_left < 8 && !left.is_leaf; ++to_left) {
      const Float4 of_left(left.cost(to_left)), this_share(static_cast<float>(to_left));
      for (std::size_t half = 0; half < 2; ++half) {
        const Float4 sum = of_left + Float4::load_unaligned(of_right + 4 * half + 1 - to_left);
        share[half] = select_less(sum, cost[half], this_share, share[half]);
        cost[half] = min(sum, cost[half]);
      }
    }
    for (std::size_t half = 0; half < 2; ++half) both.costs[half] = cost[half], both.left_shares[half] = share[half];
  }

  void collect_leaf(const Bvh2Node& node, LeafContents& contents) const noexcept {
    if (node.count > SmallSet::kMost) return;
    contents.reference_count = node.count;
    for (std::uint32_t i = 0; i < node.count; ++i) {
      const std::uint32_t primitive = tree_.prim_indices[node.first + i];
      if (limits_vertices_) {
        const TriangleIndices corners = triangles_[primitive];
        contents.vertices.add(corners.x, corners.y, corners.z);
      }
      if (!tree_.refittable) contents.primitives.add(primitive);
    }
    contents.fits = !contents.vertices.overflows();
  }

  void join(const LeafContents& left, const LeafContents& right, LeafContents& both) const noexcept {
    both.fits = left.fits && right.fits;
    if (!both.fits) return;
    both.reference_count = left.reference_count + right.reference_count;
    if (tree_.refittable) {
      both.fits = both.reference_count <= SmallSet::kMost;
    } else {
      both.primitives = left.primitives;
      both.primitives.add(right.primitives);
      both.fits = !both.primitives.overflows();
    }
    if (!both.fits || !limits_vertices_) return;
    both.vertices = left.vertices;
    both.vertices.add(right.vertices);
    both.fits = !both.vertices.overflows();
  }

  const Bvh2& tree_;
  const bool limits_vertices_;
  const TriangleIndices* triangles_;
  const CollapseCosts costs_;
  const float memory_cost_;
  CollapseDecision* decisions_;
  std::vector<Pair> waiting_;
};

// A pair of the upper tree, or all the pairs below one node.
struct Part {
  std::uint32_t begin, end;
  bool is_subtree;
};

constexpr std::uint32_t kSubtreeSize = 8192;  // nodes that one thread plans at a time

// Returns the parts in depth-first order.
std::vector<Part> make_parts(const Bvh2& tree) {
  std::vector<Part> parts;
  std::vector<SubtreeRange> waiting{whole_range(tree)};
  while (!waiting.empty()) {
    const SubtreeRange now = waiting.back();
    waiting.pop_back();
    if (tree.nodes[now.node].is_leaf()) continue;
    const std::uint32_t first = tree.nodes[now.node].first;
    const bool is_subtree = size_of(tree, now) <= kSubtreeSize;
    parts.push_back({first, now.end, is_subtree});
    if (is_subtree) continue;
    waiting.push_back(right_range(tree, now));
    waiting.push_back(left_range(tree, now));
  }
  return parts;
}

template <class Contents>
AlignedVector<CollapseDecision> plan(const Bvh2& tree, const LeafRoom& room, const CollapseCosts& costs,
                                     ThreadPool& pool, CancelToken& cancel) {
  AlignedVector<CollapseDecision> decisions(tree.nodes.size());
  const std::vector<Part> parts = make_parts(tree);
  std::vector<PlannedPair<Contents>> planned(parts.size());
  for_chunks(pool, parts.size(), 1, cancel, [&](std::size_t begin, std::size_t end) {
    Planner<Contents> planner(tree, room, costs, decisions.data());
    for (std::size_t i = begin; i < end; ++i) {
      if (!parts[i].is_subtree) continue;
      planned[i] = planner.plan_below(parts[i].begin, parts[i].end);
      cancel.advance(tree.prim_indices.size() * (parts[i].end - parts[i].begin) / (2 * tree.nodes.size()));
    }
  });
  Planner<Contents> planner(tree, room, costs, decisions.data());
  for (std::size_t i = parts.size(); i-- > 0;) {
    if (parts[i].is_subtree) {
      planner.push(planned[i]);
    } else {
      planner.plan_pair(parts[i].begin);
    }
  }
  typename Planner<Contents>::Node root;
  planner.plan_node(0, root);
  return decisions;
}

}  // namespace

AlignedVector<CollapseDecision> plan_collapse(const Bvh2& tree, const LeafRoom& room, const CollapseCosts& costs,
                                              ThreadPool& pool, CancelToken& cancel) {
  const bool joins_leaves = room.most > 1 && !tree.has_full_leaves;
  return joins_leaves ? plan<LeafContents>(tree, room, costs, pool, cancel)
                      : plan<NoContents>(tree, room, costs, pool, cancel);
}

// Split leaves --------------------------------------------------------------------------------------------------------

namespace {

bool fits(const Bvh2& tree, const Bvh2Node& leaf, const LeafRoom& room) noexcept {
  return room.holds({tree.prim_indices.data() + leaf.first, leaf.count});
}

bool all_fit(const Bvh2& tree, const LeafRoom& room, ThreadPool& pool, CancelToken& cancel) {
  constexpr std::size_t kGrain = 32768;
  std::atomic<bool> all{true};
  for_chunks(pool, tree.nodes.size(), kGrain, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end && all.load(std::memory_order_relaxed); ++i) {
      if (tree.nodes[i].is_leaf() && !fits(tree, tree.nodes[i], room)) all.store(false, std::memory_order_relaxed);
    }
  });
  return all.load();
}

}  // namespace

Bvh2 split_leaves(const Bvh2& tree, const LeafRoom& room, ThreadPool& pool, CancelToken& cancel) {
  Bvh2 result;
  if (tree.has_full_leaves || all_fit(tree, room, pool, cancel)) return result;
  result.prim_indices = tree.prim_indices;
  result.refittable = tree.refittable;
  result.nodes.reserve(tree.nodes.size() * 2);
  result.nodes.resize(2);
  result.nodes[1] = {{}, 0, {}, 0};  // the root's sibling, unused
  struct Waiting {
    Bvh2Node node;
    std::uint32_t to;
  };
  std::vector<Waiting> waiting{{tree.nodes[0], 0}};
  for (Steps steps(cancel); !waiting.empty(); steps.step()) {
    const auto [node, to] = waiting.back();
    waiting.pop_back();
    result.nodes[to] = node;
    Bvh2Node left = node, right = node;
    if (!node.is_leaf()) {
      left = tree.nodes[node.first], right = tree.nodes[node.first + 1];
    } else if (!fits(tree, node, room)) {
      left.count = node.count / 2;
      right.first = node.first + left.count, right.count = node.count - left.count;
    } else {
      continue;
    }
    const auto pair = static_cast<std::uint32_t>(result.nodes.size());
    result.nodes[to].first = pair;
    result.nodes[to].count = 0;
    result.nodes.resize(pair + 2);
    waiting.push_back({right, pair + 1});
    waiting.push_back({left, pair});
  }
  return result;
}

}  // namespace perfect_bvh
