// The frame of every builder that splits a set of references again and again: work list, threads, node array.
// In: a splitter, which knows how to halve a range, and the root's range. Out: a Bvh2 in depth-first order.
//
// One thread writes nodes straight into the tree. More threads split the upper levels together, build each range of
// at most kSubtreeSize references into an array of its own and copy these arrays to where one thread would have put
// them: the bytes are the same.
//
// A splitter offers
//   bool split(const BuildRange& range, BuildRange& left, BuildRange& right, ThreadPool* pool) const
//     false: make a leaf. Must keep depth_allows(). `pool` is null where there is nothing to share out;
//   void write_leaf(const BuildRange& range, std::uint32_t* prim_indices) const
// and its answers depend on the range alone, never on the threads.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <memory>
#include <vector>

#include "build/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/float4.h"

namespace perfect_bvh {

// References on their way to become a node: rows [begin, begin + count) of the builder's arrays.
struct BuildRange {
  Box4 box;        // of the references
  Box4 centroids;  // of their doubled centroids
  std::uint32_t begin;
  std::uint32_t count;
  std::uint32_t depth;
  bool in_scratch;  // the rows stand in the builder's second array
};

// False where only halving the range again and again still keeps the tree within kMaxTreeDepth.
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

template <class Splitter>
class TopDownBuilder {
 public:
  TopDownBuilder(const Splitter& splitter, ThreadPool& pool, CancelToken& cancel)
      : splitter_(splitter), pool_(pool), cancel_(cancel) {}

  [[nodiscard]] Bvh2 build(const BuildRange& root) {
    Bvh2 tree;
    tree.prim_indices.resize(root.count);
    prim_indices_ = tree.prim_indices.data();
    if (pool_.thread_count() == 1 || root.count <= kSubtreeSize) {
      build_alone(root, tree);
    } else {
      build_together(root, tree);
    }
    if (tree.nodes.size() > 1)
      tree.nodes[1] = {{kInf, kInf, kInf}, 0, {-kInf, -kInf, -kInf}, 0};
    return tree;
  }

 private:
  static constexpr std::uint32_t kSubtreeSize = 4096;  // references below which a task is not divided
  static constexpr std::uint32_t kFirstPair = 2;       // nodes 0 and 1 are the root and the padding
  static constexpr float kInf = Aabb::kInfinity;

  struct Extent {
    std::uint32_t end;    // one past the last node written
    std::uint32_t depth;  // of the deepest leaf
  };

  // The upper levels while several threads work on them.
  struct Top {
    BuildRange range;
    std::unique_ptr<Top> left, right;  // both or neither
    Bvh2Node root;                     // of a subtree built alone; interior indices count from its own array
    AlignedVector<Bvh2Node> nodes;     // below that root
    std::uint32_t depth = 0;           // of its deepest leaf
  };

  static std::size_t max_nodes_below(const BuildRange& range) { return 2 * std::size_t{range.count} - 2; }

  void build_alone(const BuildRange& root, Bvh2& tree) {
    tree.nodes.resize(root.count > 1 ? kFirstPair + max_nodes_below(root) : 1);
    const Extent extent = build_subtree(root, tree.nodes[0], tree.nodes.data(), kFirstPair);
    tree.nodes.resize(extent.end > kFirstPair ? extent.end : 1);
    tree.depth = extent.depth;
  }

  // Depth first, left before right, each pair in the next free place.
  Extent build_subtree(const BuildRange& root_range, Bvh2Node& root, Bvh2Node* nodes, std::uint32_t next) {
    struct Pending {
      BuildRange range;
      Bvh2Node* node;
    };
    std::array<Pending, kMaxTreeDepth + 1> stack;
    std::size_t stacked = 0;
    BuildRange range = root_range;
    Bvh2Node* node = &root;
    Extent extent{next, range.depth};
    if (range.count <= kSubtreeSize)
      cancel_.advance(range.count);
    for (;;) {
      BuildRange left, right;
      if (splitter_.split(range, left, right, nullptr)) {
        report(range, left, right);
        write_node(*node, range.box, extent.end, 0);
        assert(stacked < stack.size());
        stack[stacked++] = {right, &nodes[extent.end + 1]};
        range = left;
        node = &nodes[extent.end];
        extent.end += 2;
        continue;
      }
      write_node(*node, range.box, range.begin, range.count);
      splitter_.write_leaf(range, prim_indices_ + range.begin);
      extent.depth = std::max(extent.depth, range.depth);
      if (stacked == 0)
        return extent;
      --stacked;
      range = stack[stacked].range;
      node = stack[stacked].node;
    }
  }

  // Work is counted when a range falls to the size that is not worth counting inside.
  void report(const BuildRange& range, const BuildRange& left, const BuildRange& right) {
    if (range.count <= kSubtreeSize)
      return;
    for (const BuildRange* child : {&left, &right}) {
      if (child->count <= kSubtreeSize)
        cancel_.advance(child->count);
    }
    cancel_.checkpoint();
  }

  void build_together(const BuildRange& root, Bvh2& tree) {
    Top top;
    top.range = root;
    TaskGroup group(pool_);
    group.run_here([&] { build_top(&top, group); });
    group.wait([this] { cancel_.checkpoint(); });

    tree.nodes.resize(kFirstPair + max_nodes_below(root));
    std::vector<Copy> copies;
    const Extent extent = place(top, tree.nodes.data(), 0, kFirstPair, copies);
    parallel_for(pool_, copies.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        copy_subtree(copies[i], tree.nodes.data());
    });
    tree.nodes.resize(extent.end > kFirstPair ? extent.end : 1);
    tree.depth = extent.depth;
  }

  void build_top(Top* top, TaskGroup& group) {
    for (;;) {
      if (top->range.count <= kSubtreeSize)
        return build_top_leaf(*top);
      auto left = std::make_unique<Top>();
      auto right = std::make_unique<Top>();
      if (!splitter_.split(top->range, left->range, right->range, &pool_))
        return build_top_leaf(*top);
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
    cancel_.checkpoint();
  }

  struct Copy {
    const Top* from;
    std::uint32_t to;
  };

  // Gives every part the place that build_alone would have given it.
  Extent place(const Top& top, Bvh2Node* nodes, std::uint32_t node, std::uint32_t next, std::vector<Copy>& copies) {
    if (!top.left) {
      nodes[node] = moved(top.root, next);
      copies.push_back({&top, next});
      return {next + static_cast<std::uint32_t>(top.nodes.size()), top.depth};
    }
    write_node(nodes[node], top.range.box, next, 0);
    const Extent left = place(*top.left, nodes, next, next + 2, copies);
    const Extent right = place(*top.right, nodes, next + 1, left.end, copies);
    return {right.end, std::max(left.depth, right.depth)};
  }

  static Bvh2Node moved(Bvh2Node node, std::uint32_t offset) {
    if (!node.is_leaf())
      node.first += offset;
    return node;
  }

  static void copy_subtree(const Copy& copy, Bvh2Node* nodes) {
    Bvh2Node* to = nodes + copy.to;
    for (const Bvh2Node& node : copy.from->nodes)
      *to++ = moved(node, copy.to);
  }

  const Splitter& splitter_;
  ThreadPool& pool_;
  CancelToken& cancel_;
  std::uint32_t* prim_indices_ = nullptr;
};

}  // namespace perfect_bvh
