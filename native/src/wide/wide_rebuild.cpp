#include "wide/wide_rebuild.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <iterator>
#include <utility>
#include <vector>

#include "builders/builder.h"
#include "core/cancel.h"
#include "wide/bottom_up.h"
#include "wide/collapse.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

// The boxes of a node's children in registers, and the children's references.
struct Family {
  std::array<Box4, kWideWidth> boxes;
  std::array<std::uint32_t, kWideWidth> child;
  std::uint32_t count = 0;
};

Family family_of(const WideNode& node) noexcept {
  Family family;
  family.count = child_count(node);
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
    const Aabb box = child_box(node, lane);
    family.boxes[lane] = {Float4(box.lower.x, box.lower.y, box.lower.z, 0),
                          Float4(box.upper.x, box.upper.y, box.upper.z, 0)};
    family.child[lane] = node.child[lane];
  }
  return family;
}

void write_family(const Family& family, WideNode& node) noexcept {
  write_planes(family.boxes.data(), node);
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) node.child[lane] = family.child[lane];
  set_visit_order(node, family.count);
}

Box4 box_around(const Family& family) noexcept {
  Box4 box = Box4::empty();
  for (std::uint32_t lane = 0; lane < family.count; ++lane) box.grow(family.boxes[lane]);
  return box;
}

// For each child of a node, the box around all the others; for an empty slot, the box around all children.
class Others {
 public:
  explicit Others(const Family& family) noexcept {
    std::array<Box4, kWideWidth> after;
    Box4 box = Box4::empty();
    for (std::uint32_t lane = kWideWidth; lane-- > 0;) {
      after[lane] = box;
      if (lane < family.count) box.grow(family.boxes[lane]);
    }
    box = Box4::empty();
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      after[lane].grow(box);
      if (lane < family.count) box.grow(family.boxes[lane]);
    }
    write_planes(after.data(), planes_);
  }

  // Returns half the surfaces of those boxes, each grown by `box`.
  [[nodiscard]] std::array<float, kWideWidth> areas_with(const Box4& box) const noexcept {
    alignas(16) float corners[8];
    box.lower.store(&corners[0]);
    box.upper.store(&corners[4]);
    alignas(16) std::array<float, kWideWidth> areas;
    for (std::uint32_t first = 0; first < kWideWidth; first += 4) {
      const auto extent = [&](std::uint32_t axis) {
        return max(Float4::load(&planes_.planes[2 * axis + 1][first]), Float4(corners[4 + axis])) -
               min(Float4::load(&planes_.planes[2 * axis][first]), Float4(corners[axis]));
      };
      const Float4 x = extent(0), y = extent(1), z = extent(2);
      (x * y + (y * z + z * x)).store(&areas[first]);
    }
    return areas;
  }

 private:
  WideNode planes_;
};

// Exchanges `child` of the node, or its first free slot, with slot `place` of its child `into`.
struct Move {
  float gain = 0;  // of half surface
  std::uint32_t child = 0, into = 0, place = 0;
};

class Rotator {
 public:
  Rotator(WideBvh& tree, WideCosts& costs) noexcept : tree_(tree), costs_(costs) {}

  // Visits a node after everything below it. Returns the number of moves.
  std::size_t visit(std::uint32_t row) {
    Family family = family_of(tree_.nodes[row]);
    std::size_t moves = 0;
    while (moves < kMostMoves) {
      const Move move = find_best(family);
      if (!(move.gain > 0)) break;
      apply(move, family);
      ++moves;
    }
    if (moves > 0) write_family(family, tree_.nodes[row]);
    costs_.set(row, tree_.nodes[row], half_area(box_around(family).extent()));
    return moves;
  }

 private:
  static constexpr std::size_t kMostMoves = 4;     // at a node: more would gain little
  static constexpr float kLeastGain = 1.0f / 256;  // of the shrinking box: smaller gains are not worth writing

  [[nodiscard]] Move find_best(const Family& family) const noexcept {
    Move best;
    for (std::uint32_t into = 0; into < family.count; ++into) {
      if (family.child[into] >= kBlockChild) continue;
      const Family below = family_of(tree_.nodes[family.child[into]]);
      const Others others(below);
      const float area = half_area(family.boxes[into].extent());
      // Only the first free slot is tried. No node is left with a single child.
      const std::uint32_t end = family.count < kWideWidth && below.count > 2 ? family.count + 1 : family.count;
      for (std::uint32_t child = 0; child < end; ++child) {
        if (child == into) continue;
        const std::array<float, kWideWidth> areas = others.areas_with(family.boxes[child]);
        for (std::uint32_t place = 0; place < below.count; ++place) {
          const float gain = area - areas[place];
          if (gain > best.gain && gain > kLeastGain * area) best = {gain, child, into, place};
        }
      }
    }
    return best;
  }

  void apply(const Move& move, Family& family) {
    const std::uint32_t row = family.child[move.into];
    Family below = family_of(tree_.nodes[row]);
    std::swap(below.boxes[move.place], family.boxes[move.child]);
    std::swap(below.child[move.place], family.child[move.child]);
    if (move.child == family.count) {
      ++family.count;
      --below.count;
      std::swap(below.boxes[move.place], below.boxes[below.count]);
      std::swap(below.child[move.place], below.child[below.count]);
    }
    family.boxes[move.into] = box_around(below);
    write_family(below, tree_.nodes[row]);
    costs_.set(row, tree_.nodes[row], half_area(family.boxes[move.into].extent()));
  }

  WideBvh& tree_;
  WideCosts& costs_;
};

// Returns the depth of the tree, with the root node included, as `depth` counts it.
std::uint32_t depth_of(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel) {
  std::vector<std::uint32_t> heights(tree.nodes.size());
  visit_bottom_up(tree, pool, cancel, [&](std::span<const std::uint32_t> rows) {
    for (std::size_t i = rows.size(); i-- > 0;) {
      std::uint32_t highest = 0;
      for (const std::uint32_t child : tree.nodes[rows[i]].child) {
        if (child != kNoChild && child < kBlockChild) highest = std::max(highest, heights[child]);
      }
      heights[rows[i]] = highest + 1;
    }
  });
  return tree.nodes.empty() ? 0 : heights[tree.root];
}

}  // namespace

std::size_t rotate_wide(WideBvh& tree, WideCosts& costs, ThreadPool& pool, CancelToken& cancel) {
  Rotator rotator(tree, costs);
  std::atomic<std::size_t> moves{0};
  visit_bottom_up(tree, pool, cancel, [&](std::span<const std::uint32_t> rows) {
    std::size_t here = 0;
    for (std::size_t i = rows.size(); i-- > 0;) here += rotator.visit(rows[i]);
    moves.fetch_add(here, std::memory_order_relaxed);
  });
  if (moves > 0) tree.depth = depth_of(tree, pool, cancel);
  return moves;
}

// Wide rebuild --------------------------------------------------------------------------------------------------------

namespace {

bool is_node(std::uint32_t child) noexcept { return child != kNoChild && child < kBlockChild; }

// The cost with children as good as when they were built.
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

// Returns the share of the leaves' cost in each part that their motion did not cause.
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

// Returns the costs to compare a spliced tree with from now on: see rebuild_parts().
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
    // There is no other tree over the leaves of a single node, and a subtree as good as new needs none.
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
