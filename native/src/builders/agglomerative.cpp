#include "builders/agglomerative.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "builders/match_tree.h"
#include "builders/top_down.h"

namespace perfect_bvh {
namespace {

// Which clusters were joined. Cluster leaf_count + i is the union of pairs[i].
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

// `chain` holds clusters each of which is the best match of the one before it.
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
    hint = joined;  // what the chain's end was drawn to is now part of this
    if (chain.empty()) {
      chain.push_back(joined);
      hint = MatchTree::kNone;
    }
    if (joins.pairs.size() % kJoinsBetweenChecks == 0) cancel.checkpoint();
  }
  return joins;
}

// Writes the joins from the top down, in the order of Bvh2.
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

  // In the order of the joins: neighbours stay together.
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

  // Calls itself as deep as halving takes, 32 times at most.
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

}  // namespace perfect_bvh
