#include "wide/wide_rebuild.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "builders/builder.h"
#include "core/steps.h"
#include "wide/collapse.h"
#include "wide/wide_boxes.h"

namespace perfect_bvh {
namespace {

bool is_node(std::uint32_t child) noexcept { return child != kNoChild && child < kBlockChild; }

// With children as good as when they were built.
double cost_of_arrangement(const WideNode& node, const WideCosts& fresh) noexcept {
  const auto area = static_cast<double>(node_box(node).half_area());
  if (!(area > 0)) return 0;
  const std::array<float, kWideWidth> areas = child_areas(node);
  double sum = 0;
  for (std::uint32_t lane = 0; lane < kWideWidth && node.child[lane] != kNoChild; ++lane) {
    sum += static_cast<double>(areas[lane]) * fresh.of(node.child[lane]);
  }
  return kWideNodeCost + sum / area;
}

std::vector<PrimRef> leaves_below(const WideBvh& tree, std::uint32_t root, CancelToken& cancel) {
  std::vector<PrimRef> leaves;
  std::vector<std::uint32_t> waiting{root};
  for (Steps steps(cancel); !waiting.empty(); steps.step()) {
    const WideNode& node = tree.nodes[waiting.back()];
    waiting.pop_back();
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      const std::uint32_t child = node.child[lane];
      if (is_node(child)) waiting.push_back(child);
      if (child < kBlockChild) continue;
      const Aabb box = child_box(node, lane);
      leaves.push_back({box.lower, child - kBlockChild, box.upper, 0});
    }
  }
  return leaves;
}

AlignedVector<WideNode> build_over_leaves(const WideBvh& tree, std::uint32_t root, const BuildConfig& given,
                                          ThreadPool& pool, CancelToken& cancel) {
  BuildConfig config;
  config.builder = given.builder, config.bins = given.bins, config.axes = given.axes;
  config.max_leaf_size = 1;
  return collapse_over_leaves(build_bvh2(leaves_below(tree, root, cancel), config, pool, cancel), pool, cancel);
}

// Writes the tree again, depth first, with the new parts in their places.
class Splicer {
 public:
  struct Origin {
    std::size_t part;  // kKept: no part
    std::uint32_t row;
  };
  static constexpr std::size_t kKept = ~std::size_t{0};

  Splicer(const AlignedVector<WideNode>& kept, std::span<const std::uint32_t> parts,
          const std::vector<AlignedVector<WideNode>>& built)
      : kept_(kept), built_(built), part_at_(kept.size(), kKept) {
    for (std::size_t i = 0; i < parts.size(); ++i) part_at_[parts[i]] = i;
  }

  void run(std::uint32_t root, CancelToken& cancel) {
    waiting_.push_back({origin_of(kKept, root), kNoParent, 0, 1});
    for (Steps steps(cancel); !waiting_.empty(); steps.step()) {
      const Waiting now = waiting_.back();
      waiting_.pop_back();
      const auto row = static_cast<std::uint32_t>(nodes_.size());
      if (now.parent != kNoParent) nodes_[now.parent].child[now.lane] = row;
      depth_ = std::max(depth_, now.depth);
      origins_.push_back(now.origin);
      const WideNode& node = nodes_.emplace_back(node_at(now.origin));
      for (std::uint32_t lane = kWideWidth; lane-- > 0;) {
        if (!is_node(node.child[lane])) continue;
        waiting_.push_back({origin_of(now.origin.part, node.child[lane]), row, lane, now.depth + 1});
      }
    }
  }

  [[nodiscard]] AlignedVector<WideNode>& nodes() noexcept { return nodes_; }
  [[nodiscard]] const std::vector<Origin>& origins() const noexcept { return origins_; }  // of each node
  [[nodiscard]] std::uint32_t depth() const noexcept { return depth_; }

 private:
  struct Waiting {
    Origin origin;
    std::uint32_t parent, lane, depth;
  };
  static constexpr std::uint32_t kNoParent = ~0u;

  [[nodiscard]] Origin origin_of(std::size_t part, std::uint32_t row) const noexcept {
    if (part == kKept && part_at_[row] != kKept) return {part_at_[row], 0};
    return {part, row};
  }
  [[nodiscard]] const WideNode& node_at(Origin origin) const noexcept {
    return origin.part == kKept ? kept_[origin.row] : built_[origin.part][origin.row];
  }

  const AlignedVector<WideNode>& kept_;
  const std::vector<AlignedVector<WideNode>>& built_;
  std::vector<std::size_t> part_at_;  // of kept nodes, by row
  std::vector<Waiting> waiting_;
  AlignedVector<WideNode> nodes_;
  std::vector<Origin> origins_;
  std::uint32_t depth_ = 0;
};

// How much of the leaves' cost in each part is not their motion's fault.
std::vector<double> shares_of_fresh_leaves(const WideCosts& now, const Splicer& splicer, const WideCosts& fresh,
                                           std::span<const std::uint32_t> parts, CancelToken& cancel) {
  std::vector<double> shares(parts.size(), 1.0);
  for_steps(splicer.origins().size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const auto [part, part_row] = splicer.origins()[row];
      if (part == Splicer::kKept || part_row != 0) continue;
      const auto before = static_cast<double>(fresh.leaves[parts[part]]), today = static_cast<double>(now.leaves[row]);
      shares[part] = before > 0 && before < today ? before / today : 1.0;
    }
  });
  return shares;
}

// What a spliced tree is to be compared with from now on: see rebuild_parts().
WideCosts costs_to_compare(const WideCosts& now, const Splicer& splicer, const WideCosts& fresh,
                           std::span<const std::uint32_t> parts, CancelToken& cancel) {
  const std::vector<double> shares = shares_of_fresh_leaves(now, splicer, fresh, parts, cancel);
  WideCosts compared = now;
  for_steps(splicer.origins().size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const auto [part, old_row] = splicer.origins()[row];
      if (part == Splicer::kKept) {
        compared.nodes[row] = fresh.nodes[old_row], compared.leaves[row] = fresh.leaves[old_row];
      } else {
        const double leaves = static_cast<double>(now.leaves[row]), kept_leaves = leaves * shares[part];
        compared.leaves[row] = static_cast<float>(kept_leaves);
        compared.nodes[row] = static_cast<float>(static_cast<double>(now.nodes[row]) - leaves + kept_leaves);
      }
    }
  });
  return compared;
}

}  // namespace

std::vector<std::uint32_t> find_degraded_parts(const WideBvh& tree, const WideCosts& costs, const WideCosts& fresh,
                                               double tolerance, CancelToken& cancel) {
  std::vector<std::uint32_t> parts, waiting;
  if (!tree.nodes.empty()) waiting.push_back(tree.root);
  for (Steps steps(cancel); !waiting.empty(); steps.step()) {
    const std::uint32_t row = waiting.back();
    waiting.pop_back();
    const WideNode& node = tree.nodes[row];
    // Over the leaves of a single node there is no other tree; and what is as good as new needs none.
    if (!std::any_of(node.child, node.child + kWideWidth, is_node)) continue;
    if (costs.nodes[row] <= fresh.nodes[row]) continue;
    if (cost_of_arrangement(node, fresh) > tolerance * static_cast<double>(fresh.nodes[row])) {
      parts.push_back(row);
      continue;
    }
    std::copy_if(node.child, node.child + kWideWidth, std::back_inserter(waiting), is_node);
  }
  return parts;
}

double share_of_leaves(const WideBvh& tree, std::span<const std::uint32_t> roots, CancelToken& cancel) {
  std::vector<std::uint32_t> waiting(roots.begin(), roots.end());
  std::size_t count = 0;
  for (Steps steps(cancel); !waiting.empty(); steps.step()) {
    const WideNode& node = tree.nodes[waiting.back()];
    waiting.pop_back();
    for (const std::uint32_t child : node.child) {
      if (is_node(child)) waiting.push_back(child);
      count += child >= kBlockChild ? 1 : 0;
    }
  }
  return count == 0 ? 0.0 : static_cast<double>(count) / static_cast<double>(tree.leaf_count());
}

WideCosts rebuild_parts(WideBvh& tree, WideCosts& fresh, std::span<const std::uint32_t> parts,
                        const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  if (parts.empty()) return measure_wide_costs(tree, pool, cancel);
  std::vector<AlignedVector<WideNode>> built(parts.size());
  for_chunks(pool, parts.size(), 1, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) built[i] = build_over_leaves(tree, parts[i], config, pool, cancel);
  });
  Splicer splicer(tree.nodes, parts, built);
  splicer.run(tree.root, cancel);
  std::swap(tree.nodes, splicer.nodes());
  tree.root = 0, tree.depth = splicer.depth();
  WideCosts now = measure_wide_costs(tree, pool, cancel);
  fresh = costs_to_compare(now, splicer, fresh, parts, cancel);
  return now;
}

}  // namespace perfect_bvh
