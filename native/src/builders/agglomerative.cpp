#include "builders/agglomerative.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "builders/match_tree.h"
#include "builders/top_down.h"
#include "math/sorting_network.h"

namespace perfect_bvh {
namespace {

// The clusters that were joined. Cluster leaf_count + i is the union of pairs[i].
struct Joins {
  struct Pair {
    std::uint32_t left, right, count;
  };
  std::uint32_t leaf_count;
  std::vector<Pair> pairs;

  [[nodiscard]] bool is_leaf(std::uint32_t cluster) const noexcept { return cluster < leaf_count; }
  [[nodiscard]] const Pair& pair_of(std::uint32_t cluster) const noexcept { return pairs[cluster - leaf_count]; }
  [[nodiscard]] std::uint32_t count_of(std::uint32_t cluster) const noexcept {
    return is_leaf(cluster) ? 1 : pair_of(cluster).count;
  }
};

// In `chain`, each cluster is the best match of the one before it.
Joins join_best_matches(MatchTree& tree, CancelToken& cancel) {
  constexpr std::uint32_t kJoinsBetweenChecks = 1024;
  Joins joins{tree.leaf_count(), {}};
  joins.pairs.reserve(tree.leaf_count());
  std::vector<std::uint32_t> chain{0};
  std::uint32_t hint = MatchTree::kNone;
  while (joins.pairs.size() + 1 < tree.leaf_count()) {
    const std::uint32_t last = chain.back();
    const std::uint32_t before = chain.size() > 1 ? chain[chain.size() - 2] : MatchTree::kNone;
    const std::uint32_t best = tree.find_best(last, hint);
    if (best != before) {
      chain.push_back(best);
      hint = last;
      continue;
    }
    const std::uint32_t joined = tree.join(before, last);
    joins.pairs.push_back({before, last, joins.count_of(before) + joins.count_of(last)});
    chain.resize(chain.size() - 2);
    hint = joined;  // the end of the chain matched a cluster that is now part of this one
    if (chain.empty()) {
      chain.push_back(joined);
      hint = MatchTree::kNone;
    }
    if (joins.pairs.size() % kJoinsBetweenChecks == 0) cancel.checkpoint();
  }
  return joins;
}

// Writes the joins from the top down, in the order of a Bvh2.
class JoinWriter {
 public:
  JoinWriter(const Joins& joins, const MatchTree& tree, std::span<const PrimRef> prims)
      : joins_(joins), tree_(tree), prims_(prims) {}

  Bvh2 write(std::uint32_t levels_above) {
    const std::uint32_t count = joins_.leaf_count;
    out_.prim_indices.reserve(count);
    out_.nodes.reserve(2 * std::size_t{count});
    out_.nodes.resize(count > 1 ? 2 : 1);
    if (count > 1) write_node(out_.nodes[1], Box4::empty(), 0, 0);
    stack_.push_back({2 * count - 2, 0, levels_above});
    while (!stack_.empty()) {
      const Pending now = stack_.back();
      stack_.pop_back();
      out_.depth = std::max(out_.depth, now.depth);
      if (joins_.is_leaf(now.cluster)) {
        write_leaf(tree_.row_of(now.cluster), now.node);
      } else if (depth_allows_any_split({0, joins_.count_of(now.cluster), now.depth})) {
        const Joins::Pair& pair = joins_.pair_of(now.cluster);
        const std::uint32_t first = add_children(now.node);
        stack_.push_back({pair.right, first + 1, now.depth + 1});
        stack_.push_back({pair.left, first, now.depth + 1});
      } else {
        const auto rows = rows_below(now.cluster);
        write_halves(rows, now.node, now.depth);
      }
    }
    out_.depth -= levels_above;
    for (std::size_t i = out_.nodes.size(); i-- > 0;) {
      if (!out_.nodes[i].is_leaf() && i != 1) enclose_children(out_.nodes[i], &out_.nodes[out_.nodes[i].first]);
    }
    return std::move(out_);
  }

 private:
  struct Pending {
    std::uint32_t cluster, node, depth;
  };

  std::uint32_t add_children(std::uint32_t node) {
    const auto first = static_cast<std::uint32_t>(out_.nodes.size());
    out_.nodes.resize(first + 2);
    out_.nodes[node].first = first;
    out_.nodes[node].count = 0;
    return first;
  }

  void write_leaf(std::uint32_t row, std::uint32_t node) {
    const Box4 box = Box4::load(&prims_[row]);
    const Float4 zero(0.0f);  // -0 + 0 is +0
    perfect_bvh::write_node(out_.nodes[node], {box.lower + zero, box.upper + zero},
                            static_cast<std::uint32_t>(out_.prim_indices.size()), 1);
    out_.prim_indices.push_back(row);
  }

  // Rows are in the order of the joins, so that neighbours stay together.
  [[nodiscard]] std::vector<std::uint32_t> rows_below(std::uint32_t cluster) const {
    std::vector<std::uint32_t> rows, pending{cluster};
    while (!pending.empty()) {
      const std::uint32_t now = pending.back();
      pending.pop_back();
      if (joins_.is_leaf(now)) {
        rows.push_back(tree_.row_of(now));
      } else {
        pending.insert(pending.end(), {joins_.pair_of(now).right, joins_.pair_of(now).left});
      }
    }
    return rows;
  }

  // Recursive: as deep as the halving, at most 32 levels.
  void write_halves(std::span<const std::uint32_t> rows, std::uint32_t node, std::uint32_t depth) {
    out_.depth = std::max(out_.depth, depth);
    if (rows.size() == 1) return write_leaf(rows[0], node);
    const std::uint32_t first = add_children(node);
    write_halves(rows.first(rows.size() / 2), first, depth + 1);
    write_halves(rows.subspan(rows.size() / 2), first + 1, depth + 1);
  }

  const Joins& joins_;
  const MatchTree& tree_;
  std::span<const PrimRef> prims_;
  Bvh2 out_;
  std::vector<Pending> stack_;
};

}  // namespace

Bvh2 build_agglomerative(const Bvh2& guide, std::uint32_t node, std::span<const PrimRef> prims, CancelToken& cancel,
                         std::uint32_t levels_above) {
  if (guide.empty()) return {};
  cancel.checkpoint();
  MatchTree tree(guide, node, prims);
  const Joins joins = join_best_matches(tree, cancel);
  return JoinWriter(joins, tree, prims).write(levels_above);
}

// Few boxes -----------------------------------------------------------------------------------------------------------

namespace {

struct Costs {
  float traversal;
  float intersection;
  std::uint32_t max_leaf_size;

  // Returns the cheaper of a leaf and a split whose parts cost `parts`, for boxes whose union has this area.
  [[nodiscard]] float best(float area, std::uint32_t count, float parts) const noexcept {
    const float split = traversal * area + parts;
    return count <= max_leaf_size ? std::min(split, intersection * area * static_cast<float>(count)) : split;
  }
};

[[nodiscard]] float area_of(GridBox box) noexcept { return static_cast<float>(half_area(box)); }

struct Choice {
  float cost;
  std::uint32_t left;

  void offer(float other_cost, std::uint32_t other_left) noexcept {
    left = other_cost < cost ? other_left : left;
    cost = std::min(cost, other_cost);
  }
};

// Returns the cost of one leaf with all boxes, or a prohibitive cost if it would be too large.
[[nodiscard]] Choice leaf(std::uint32_t count, float area, const Costs& costs) noexcept {
  constexpr float kNever = std::numeric_limits<float>::max();
  return {count <= costs.max_leaf_size ? costs.intersection * area * static_cast<float>(count) : kNever, 0};
}

std::uint32_t split_two(const GridBox* b, float area, const Costs& costs) noexcept {
  Choice choice = leaf(2, area, costs);
  choice.offer(costs.traversal * area + costs.intersection * (area_of(b[0]) + area_of(b[1])), 0b01);
  return choice.left;
}

std::uint32_t split_three(const GridBox* b, float area, const Costs& costs) noexcept {
  const float a = costs.intersection * area_of(b[0]);
  const float b1 = costs.intersection * area_of(b[1]);
  const float c = costs.intersection * area_of(b[2]);
  const float root = costs.traversal * area;
  Choice choice = leaf(3, area, costs);
  choice.offer(root + a + costs.best(area_of(min(b[1], b[2])), 2, b1 + c), 0b001);
  choice.offer(root + b1 + costs.best(area_of(min(b[0], b[2])), 2, a + c), 0b010);
  choice.offer(root + c + costs.best(area_of(min(b[0], b[1])), 2, a + b1), 0b100);
  return choice.left;
}

// Finds the best tree over four boxes; all 15 are priced.
std::uint32_t split_four(const GridBox* b, float area, const Costs& costs) noexcept {
  std::array<float, 4> one;
  for (std::size_t i = 0; i < 4; ++i) one[i] = costs.intersection * area_of(b[i]);
  const auto pair = [&](std::size_t i, std::size_t j, GridBox both) {
    return costs.best(area_of(both), 2, one[i] + one[j]);
  };
  const GridBox box01 = min(b[0], b[1]), box23 = min(b[2], b[3]);
  const float p01 = pair(0, 1, box01), p23 = pair(2, 3, box23);
  const float p02 = pair(0, 2, min(b[0], b[2])), p13 = pair(1, 3, min(b[1], b[3]));
  const float p03 = pair(0, 3, min(b[0], b[3])), p12 = pair(1, 2, min(b[1], b[2]));
  const auto triple = [&](GridBox all, float x, float y, float z) {
    return costs.best(area_of(all), 3, std::min({x, y, z}));
  };
  const float without0 = triple(min(b[1], box23), p12 + one[3], p13 + one[2], p23 + one[1]);
  const float without1 = triple(min(b[0], box23), p02 + one[3], p03 + one[2], p23 + one[0]);
  const float without2 = triple(min(box01, b[3]), p01 + one[3], p03 + one[1], p13 + one[0]);
  const float without3 = triple(min(box01, b[2]), p01 + one[2], p02 + one[1], p12 + one[0]);
  const float root = costs.traversal * area;
  Choice choice = leaf(4, area, costs);
  choice.offer(root + p01 + p23, 0b0011);
  choice.offer(root + p02 + p13, 0b0101);
  choice.offer(root + p03 + p12, 0b1001);
  choice.offer(root + one[0] + without0, 0b0001);
  choice.offer(root + one[1] + without1, 0b0010);
  choice.offer(root + one[2] + without2, 0b0100);
  choice.offer(root + one[3] + without3, 0b1000);
  return choice.left;
}

void order(Float4& a, Float4& b) noexcept {
  const Float4 smaller = min(a, b);
  b = max(a, b);
  a = smaller;
}

using AxisBoxes = std::array<GridBox, 3>;

// The boxes in the order of their centroids along each axis.
struct Sorted {
  alignas(16) std::array<std::array<std::int32_t, 4>, kFewBoxes> ranks;  // rank, axis: number of the box
  const GridBox* boxes;

  Sorted(const GridBox* all, std::uint32_t count) noexcept : boxes(all) {
    std::array<Float4, kFewBoxes> keys;
    for (std::uint32_t i = 0; i < kFewBoxes; ++i) {
      // Centroid * 8 + number: exact in a float, and no two are equal.
      keys[i] = i < count ? lanes_to_float(doubled_centroid(all[i])) * Float4(8.0f) + Float4(static_cast<float>(i))
                          : Float4(std::numeric_limits<float>::max());
    }
    sort_eight(keys, order);  // three axes at once
    for (std::uint32_t rank = 0; rank < count; ++rank) truncate(keys[rank]).store(ranks[rank].data());
  }
  [[nodiscard]] std::uint32_t number(std::uint32_t rank, std::size_t axis) const noexcept {
    return static_cast<std::uint32_t>(ranks[rank][axis]) % kFewBoxes;
  }
  void grow(AxisBoxes& to, std::uint32_t rank) const noexcept {
    for (std::size_t axis = 0; axis < 3; ++axis) to[axis] = min(to[axis], boxes[number(rank, axis)]);
  }
};

std::uint32_t split_eight(const GridBox* boxes, std::uint32_t count, float area, const Costs& costs) noexcept {
  const Sorted sorted(boxes, count);
  const AxisBoxes empty{empty_grid_box(), empty_grid_box(), empty_grid_box()};
  std::array<Float4, kFewBoxes> right_costs;
  AxisBoxes box = empty;
  for (std::uint32_t i = count - 1; i > 0; --i) {
    sorted.grow(box, i);
    right_costs[i] = half_areas(box) * Float4(static_cast<float>(count - i));
  }
  box = empty;
  Float4 best_cost(area * static_cast<float>(count)), best_rank(0.0f);
  for (std::uint32_t i = 1; i < count; ++i) {
    sorted.grow(box, i - 1);
    const Float4 rank(static_cast<float>(i));
    const Float4 cost = half_areas(box) * rank + right_costs[i];
    best_rank = select_less(cost, best_cost, rank, best_rank);
    best_cost = min(cost, best_cost);
  }
  alignas(16) std::array<float, 4> cost, rank;
  best_cost.store(cost.data());
  best_rank.store(rank.data());
  const auto axis = static_cast<std::size_t>(std::min_element(cost.begin(), cost.begin() + 3) - cost.begin());
  Choice choice = leaf(count, area, costs);
  std::uint32_t left = 0;
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(rank[axis]); ++i) left |= 1u << sorted.number(i, axis);
  choice.offer(costs.traversal * area + costs.intersection * cost[axis], left);
  return choice.left;
}

}  // namespace

std::uint32_t split_few(const GridBox* boxes, std::uint32_t count, float area, const BuildConfig& config) noexcept {
  const Costs costs{config.traversal_cost, config.intersection_cost, config.max_leaf_size};
  switch (count) {
    case 2:
      return split_two(boxes, area, costs);
    case 3:
      return split_three(boxes, area, costs);
    case 4:
      return split_four(boxes, area, costs);
    default:
      return split_eight(boxes, count, area, costs);
  }
}

}  // namespace perfect_bvh
