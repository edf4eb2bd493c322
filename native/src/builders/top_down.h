// The common frame of all builders that repeatedly split a set of references: work list, threads, node array.
// In: a splitter, which can halve a range, and the root's range. Out: a Bvh2 in depth-first order.
//
// A single thread writes nodes directly into the tree. Several threads split the upper levels together, build each
// range of at most kSubtreeSize references into a separate array, and copy these arrays to the positions where one
// thread would have put them: the bytes are the same. Boxes are computed from the leaves upwards, while a subtree's
// nodes are still in cache.
//
// A splitter provides
//   Range: a type with the members of BuildRange; also `capacity` and `work` if references may multiply:
//     leaves then leave rows of prim_indices unused, which the splitter's owner must close up;
//   kSubtreeSize: the number of references of a task that is not divided further;
//   void split_large(Range& range, Range& left, Range& right, ThreadPool* pool)
//     for ranges above kSubtreeSize. `pool` is null if one thread works alone;
//   Worker enter_subtree(Range& range)
//     called once for each range of at most that size; the worker then makes the rest of its subtree, and provides
//   bool split(Range& range, Range& left, Range& right)
//     false: make a leaf;
//   Box4 write_leaf(const Range& range, std::uint32_t* prim_indices)
//     fills in the leaf's rows and returns its box, zeros positive.
// All must respect depth_allows_any_split(). Results depend only on the range, never on the threads. Loops over a range
// of any size must check for cancellation (core/cancel.h); a subtree is small enough to be made between two checks.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/float4.h"

namespace perfect_bvh {

// References that will become a node: rows [begin, begin + count) of the builder's arrays.
struct BuildRange {
  std::uint32_t begin = 0;
  std::uint32_t count = 0;
  std::uint32_t depth = 0;
};

// Gives the first `left_count` references to `left`, the others to `right`.
inline void divide_rows(const BuildRange& range, std::uint32_t left_count, BuildRange& left,
                        BuildRange& right) noexcept {
  left.begin = range.begin;
  left.count = left_count;
  right.begin = range.begin + left_count;
  right.count = range.count - left_count;
  left.depth = right.depth = range.depth + 1;
}

// Returns the rows that belong to a range: more than it has references if it may still get some (spatial splits).
template <class Range>
[[nodiscard]] std::uint32_t capacity_of(const Range& range) noexcept {
  if constexpr (requires { range.capacity; }) return range.capacity;
  return range.count;
}

// Returns the units of work of a range: one per primitive, even if there are more references.
template <class Range>
[[nodiscard]] std::uint32_t work_of(const Range& range) noexcept {
  if constexpr (requires { range.work; }) return range.work;
  return range.count;
}

// Returns false if only halving the range repeatedly still keeps the tree within kMaxTreeDepth.
[[nodiscard]] inline bool depth_allows_any_split(const BuildRange& range) noexcept {
  const auto levels_to_halve = static_cast<std::uint32_t>(std::bit_width(range.count));
  return range.depth + levels_to_halve < kMaxTreeDepth;
}

inline void write_node(Bvh2Node& node, const Box4& box, std::uint32_t first, std::uint32_t count) noexcept {
  box.lower.store(&node.lower);
  box.upper.store(&node.upper);
  node.first = first;
  node.count = count;
}

// Computes an interior node's box from its children's.
inline void enclose_children(Bvh2Node& node, const Bvh2Node* children) noexcept {
  Box4 box = Box4::load(&children[0]);
  box.grow(Box4::load(&children[1]));
  write_node(node, box, node.first, 0);
}

template <class Splitter>
class TopDownBuilder {
 public:
  using Range = typename Splitter::Range;
  static constexpr std::uint32_t kSubtreeSize = Splitter::kSubtreeSize;

  TopDownBuilder(Splitter& splitter, ThreadPool& pool, CancelToken& cancel)
      : splitter_(splitter), pool_(pool), cancel_(cancel) {}

  [[nodiscard]] Bvh2 build(const Range& root) {
    Bvh2 tree;
    tree.prim_indices.resize(capacity_of(root));
    tree.nodes.resize(kFirstPair + max_nodes_below(root));
    prim_indices_ = tree.prim_indices.data();
    nodes_ = tree.nodes.data();
    cancel_.checkpoint();
    const Extent extent =
        pool_.thread_count() == 1 || root.count <= kSubtreeSize ? build_alone(root) : build_together(root);
    for (auto node = top_nodes_.rbegin(); node != top_nodes_.rend(); ++node) {
      enclose_children(nodes_[*node], &nodes_[nodes_[*node].first]);
    }
    tree.nodes.resize(extent.end > kFirstPair ? extent.end : 1);
    tree.depth = extent.depth;
    if (tree.nodes.size() > 1) write_node(tree.nodes[1], Box4::empty(), 0, 0);
    return tree;
  }

 private:
  static constexpr std::uint32_t kFirstPair = 2;  // nodes 0 and 1 are the root and the padding

  struct Extent {
    std::uint32_t end;    // one past the last node written
    std::uint32_t depth;  // of the deepest leaf
  };
  struct Pending {
    Range range;
    std::uint32_t node;
  };
  using Stack = std::array<Pending, kMaxTreeDepth + 1>;

  static std::size_t max_nodes_below(const Range& range) { return 2 * std::size_t{capacity_of(range)} - 2; }

  // One thread -----------------------------------------------------------------------------------------------------

  Extent build_alone(const Range& root) {
    Stack stack;
    std::size_t stacked = 0;
    Pending now{root, 0};
    Extent extent{kFirstPair, 0};
    for (;;) {
      Range left, right;
      if (now.range.count > kSubtreeSize) {
        splitter_.split_large(now.range, left, right, nullptr);
        cancel_.checkpoint();
        nodes_[now.node].first = extent.end;
        top_nodes_.push_back(now.node);
        assert(stacked < stack.size());
        stack[stacked++] = {right, extent.end + 1};
        now = {left, extent.end};
        extent.end += 2;
        continue;
      }
      const Extent subtree = build_subtree(now.range, nodes_[now.node], nodes_, extent.end);
      extent = {subtree.end, std::max(extent.depth, subtree.depth)};
      if (stacked == 0) return extent;
      now = stack[--stacked];
    }
  }

  // Depth first, left before right; each pair is written to the next free rows from `begin` on.
  Extent build_subtree(const Range& root_range, Bvh2Node& root, Bvh2Node* nodes, std::uint32_t begin) {
    struct PendingNode {
      Range range;
      Bvh2Node* node;
    };
    std::array<PendingNode, kMaxTreeDepth + 1> stack;
    std::size_t stacked = 0;
    PendingNode now{root_range, &root};
    auto&& worker = splitter_.enter_subtree(now.range);
    Extent extent{begin, now.range.depth};
    for (;;) {
      Range left, right;
      if (worker.split(now.range, left, right)) {
        now.node->first = extent.end;
        now.node->count = 0;
        assert(stacked < stack.size());
        stack[stacked++] = {right, &nodes[extent.end + 1]};
        now = {left, &nodes[extent.end]};
        extent.end += 2;
        continue;
      }
      const Box4 box = worker.write_leaf(now.range, prim_indices_ + now.range.begin);
      write_node(*now.node, box, now.range.begin, now.range.count);
      extent.depth = std::max(extent.depth, now.range.depth);
      if (stacked == 0) break;
      now = stack[--stacked];
    }
    for (std::uint32_t i = extent.end; i-- > begin;) {
      if (!nodes[i].is_leaf()) enclose_children(nodes[i], &nodes[nodes[i].first]);
    }
    if (!root.is_leaf()) enclose_children(root, &nodes[root.first]);
    cancel_.advance(work_of(root_range));
    cancel_.checkpoint();
    return extent;
  }

  // More threads ---------------------------------------------------------------------------------------------------

  // The upper levels, while several threads work on them.
  struct Top {
    Range range;
    std::unique_ptr<Top> left, right;  // both or neither
    Bvh2Node root;                     // of a subtree built alone; interior indices refer to its own array
    AlignedVector<Bvh2Node> nodes;     // below that root
    std::uint32_t depth = 0;           // of its deepest leaf
  };
  struct Copy {
    const Top* from;
    std::uint32_t to;
  };

  Extent build_together(const Range& root) {
    Top top;
    top.range = root;
    TaskGroup group(pool_);
    group.run_here([&] { build_top(&top, group); });
    group.wait([this] { cancel_.checkpoint(); });

    std::vector<Copy> copies;
    const Extent extent = place(top, 0, kFirstPair, copies);
    for_chunks(pool_, copies.size(), 1, cancel_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) copy_subtree(copies[i]);
    });
    return extent;
  }

  void build_top(Top* top, TaskGroup& group) {
    for (;;) {
      if (top->range.count <= kSubtreeSize) return build_top_leaf(*top);
      auto left = std::make_unique<Top>();
      auto right = std::make_unique<Top>();
      splitter_.split_large(top->range, left->range, right->range, &pool_);
      cancel_.checkpoint();
      top->left = std::move(left);
      top->right = std::move(right);
      group.run([this, &group, child = top->right.get()] { build_top(child, group); });
      top = top->left.get();
    }
  }

  void build_top_leaf(Top& top) {
    top.nodes.resize(max_nodes_below(top.range));
    const Extent extent = build_subtree(top.range, top.root, top.nodes.data(), 0);
    top.nodes.resize(extent.end);
    top.depth = extent.depth;
  }

  // Gives every part the rows that build_alone would have given it.
  // The few nodes written here are the first in their memory pages: most of the time is spent by the system clearing
  // those.
  Extent place(const Top& top, std::uint32_t node, std::uint32_t next, std::vector<Copy>& copies) {
    cancel_.checkpoint();
    if (!top.left) {
      nodes_[node] = moved(top.root, next);
      copies.push_back({&top, next});
      return {next + static_cast<std::uint32_t>(top.nodes.size()), top.depth};
    }
    nodes_[node].first = next;
    top_nodes_.push_back(node);
    const Extent left = place(*top.left, next, next + 2, copies);
    const Extent right = place(*top.right, next + 1, left.end, copies);
    return {right.end, std::max(left.depth, right.depth)};
  }

  static Bvh2Node moved(Bvh2Node node, std::uint32_t offset) {
    if (!node.is_leaf()) node.first += offset;
    return node;
  }

  void copy_subtree(const Copy& copy) {
    Bvh2Node* to = nodes_ + copy.to;
    for (const Bvh2Node& node : copy.from->nodes) *to++ = moved(node, copy.to);
  }

  Splitter& splitter_;
  ThreadPool& pool_;
  CancelToken& cancel_;
  std::uint32_t* prim_indices_ = nullptr;
  Bvh2Node* nodes_ = nullptr;
  std::vector<std::uint32_t> top_nodes_;  // interior nodes above the subtrees, parents first
};

// Select nth ----------------------------------------------------------------------------------------------------------
// Selection (std::nth_element) that checks for cancellation while it works on many items. The arrangement is the same
// either way.

// This many take a few milliseconds. For fewer, comparisons are not counted.
inline constexpr std::size_t kMostSelectedUnasked = 131072;

// Puts the item with rank `n` at position `n`, smaller ones before it and the others behind. If cancelled, throws
// Cancelled; the order of the items is then undefined.
template <class Item, class Less>
void select_nth(std::span<Item> items, std::size_t n, CancelToken& cancel, const Less& less) {
  const auto nth = items.begin() + static_cast<std::ptrdiff_t>(n);
  if (items.size() <= kMostSelectedUnasked) return std::nth_element(items.begin(), nth, items.end(), less);
  Steps steps(cancel);
  std::nth_element(items.begin(), nth, items.end(), [&](const Item& a, const Item& b) {
    steps.step();
    return less(a, b);
  });
}

}  // namespace perfect_bvh
