#include "wide/fast_wide.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>
#include <vector>

#include "builders/locally_ordered.h"
#include "core/scratch.h"
#include "core/steps.h"
#include "wide/cluster_plan.h"
#include "wide/leaf_block.h"
#include "wide/morton_leaves.h"
#include "wide/visit_order.h"
#include "wide/wide_boxes.h"

namespace perfect_bvh {
namespace {

struct Child {
  std::uint32_t cluster;
  std::uint32_t row, lane;  // where it is to be entered
  std::uint32_t depth;      // of the node that it becomes
};

constexpr std::uint32_t kNoParent = ~0u;  // as `row`: the root

// The children of a wide node, as planned.
class Spreader {
 public:
  Spreader(const ClusterTree& tree, std::span<const PlacesPlan> plans) noexcept
      : tree_(tree), plans_(plans), leaf_count_(tree.box_count) {}

  void spread(std::uint32_t cluster) noexcept {
    count_ = 0;
    const std::uint32_t to_left = plans_[cluster - leaf_count_].to_left(1);
    spread(tree_.clusters[cluster].left, to_left);
    spread(tree_.clusters[cluster].right, kWideWidth - to_left);
  }

  [[nodiscard]] std::uint32_t count() const noexcept { return count_; }
  [[nodiscard]] std::uint32_t child(std::uint32_t lane) const noexcept { return children_[lane]; }
  [[nodiscard]] bool is_leaf(std::uint32_t lane) const noexcept { return children_[lane] < leaf_count_; }
  [[nodiscard]] Box4 box(std::uint32_t lane) const noexcept { return tree_.clusters[children_[lane]].box(); }

 private:
  void spread(std::uint32_t cluster, std::uint32_t places) noexcept {
    const std::uint32_t to_left =
        places == 1 || cluster < leaf_count_ ? 0 : plans_[cluster - leaf_count_].to_left(places);
    if (to_left == 0) {
      children_[count_++] = cluster;
      return;
    }
    spread(tree_.clusters[cluster].left, to_left);
    spread(tree_.clusters[cluster].right, places - to_left);
  }

  const ClusterTree& tree_;
  std::span<const PlacesPlan> plans_;
  std::uint32_t leaf_count_;
  std::array<std::uint32_t, kWideWidth> children_;
  std::uint32_t count_ = 0;
};

// Goes through wide nodes as planned, depth first.
class Walk {
 public:
  Walk(const ClusterTree& tree, std::span<const PlacesPlan> plans) noexcept : spreader_(tree, plans) {}

  // Calls body(now, node's children, row) for everything below `root`, rows counted from `row` on; clusters numbered
  // below `end` are left to others and added to `left`. Returns the first row that is free.
  template <class Body>
  std::uint32_t run(const Child& root, std::uint32_t end, std::uint32_t row, std::vector<Child>& left,
                    CancelToken& cancel, const Body& body) {
    waiting_.assign(1, root);
    for (Steps steps(cancel); !waiting_.empty(); steps.step(), ++row) {
      const Child now = waiting_.back();
      waiting_.pop_back();
      spreader_.spread(now.cluster);
      body(now, spreader_, row);
      for (std::uint32_t lane = spreader_.count(); lane-- > 0;) {
        if (spreader_.is_leaf(lane)) continue;
        const Child child{spreader_.child(lane), row, lane, now.depth + 1};
        (child.cluster < end ? left : waiting_).push_back(child);
      }
    }
    return row;
  }

 private:
  Spreader spreader_;
  std::vector<Child> waiting_;
};

void write_node(const Spreader& children, WideNode& node) noexcept {
  std::array<Box4, kWideWidth> boxes;
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
    const bool is_taken = lane < children.count();
    boxes[lane] = is_taken ? children.box(lane) : Box4::empty();
    node.child[lane] = is_taken && children.is_leaf(lane) ? kBlockChild + children.child(lane) : kNoChild;
  }
  write_planes(boxes.data(), node);
  set_visit_order(node, children.count());
}

// Subtrees are shared out over threads: they are first counted, then written where they belong.
class Assembly {
 public:
  Assembly(const ClusterTree& tree, std::span<const PlacesPlan> plans, ThreadPool& pool, CancelToken& cancel)
      : tree_(tree), plans_(plans), pool_(pool), cancel_(cancel) {}

  void run(WideBvh& wide) {
    const Child root{tree_.root, kNoParent, 0, 1};
    const std::vector<Group> groups = count(root);
    for (const Group& group : groups) wide.depth = std::max(wide.depth, group.depth);
    wide.nodes.resize(groups.back().end_row);
    WideNode* const nodes = wide.nodes.data();
    const auto write = [nodes](const Child& now, const Spreader& children, std::uint32_t row) {
      if (now.row != kNoParent) nodes[now.row].child[now.lane] = row;
      write_node(children, nodes[row]);
    };
    std::vector<Child> below;
    static_cast<void>(Walk(tree_, plans_).run(root, tree_.top.begin, 0, below, cancel_, write));
    for_groups([&](Walk& walk, std::size_t group, std::span<const Child> subtrees) {
      std::uint32_t row = groups[group].end_row;  // of the one before
      std::vector<Child> none;
      for (const Child& subtree : subtrees) row = walk.run(subtree, 0, row, none, cancel_, write);
    });
  }

 private:
  static constexpr std::size_t kGroup = 64;  // subtrees

  // The upper nodes, or those of some subtrees.
  struct Group {
    std::uint32_t end_row, depth;
  };

  // Finds the subtrees. The upper nodes come first.
  std::vector<Group> count(const Child& root) {
    std::uint32_t depth = 0;
    const std::uint32_t upper_count =
        Walk(tree_, plans_)
            .run(root, tree_.top.begin, 0, subtrees_, cancel_,
                 [&](const Child& now, const Spreader&, std::uint32_t) { depth = std::max(depth, now.depth); });
    std::vector<Group> groups((subtrees_.size() + kGroup - 1) / kGroup + 1);
    groups[0] = {upper_count, depth};
    for_groups([&](Walk& walk, std::size_t group, std::span<const Child> subtrees) {
      std::vector<Child> none;
      Group found{0, 0};
      for (const Child& subtree : subtrees) {
        found.end_row = walk.run(
            subtree, 0, found.end_row, none, cancel_,
            [&](const Child& now, const Spreader&, std::uint32_t) { found.depth = std::max(found.depth, now.depth); });
      }
      groups[group + 1] = found;
    });
    for (std::size_t i = 1; i < groups.size(); ++i) groups[i].end_row += groups[i - 1].end_row;
    return groups;
  }

  // body(walk, group's number, its subtrees)
  template <class Body>
  void for_groups(const Body& body) {
    for_chunks(pool_, subtrees_.size(), kGroup, cancel_, [&](std::size_t begin, std::size_t end) {
      Walk walk(tree_, plans_);
      body(walk, begin / kGroup, std::span<const Child>(subtrees_).subspan(begin, end - begin));
    });
  }

  const ClusterTree& tree_;
  std::span<const PlacesPlan> plans_;
  ThreadPool& pool_;
  CancelToken& cancel_;
  std::vector<Child> subtrees_;
};

}  // namespace

WideBvh build_fast_wide(const Mesh& mesh, ThreadPool& pool, CancelToken& cancel) {
  WideBvh wide;
  if (mesh.primitive_count() == 0) return wide;
  Scratch tree_memory;
  MortonLeaves leaves = make_morton_leaves(mesh, tree_memory, pool, cancel);
  wide = std::move(leaves.tree);
  wide.is_empty = false;
  wide.extent = tree_extent(leaves.bounds, wide.scale);
  if (wide.leaf_count() == 1) {
    wide.root = kBlockChild;
    return wide;
  }
  const ClusterTree tree = cluster_along_curve(leaves.boxes, pool, cancel);
  tree_memory.trim(leaves.boxes.clusters, tree.top.end);
  const auto plans = plan_places(tree, tree_memory, pool, cancel);
  Assembly(tree, plans, pool, cancel).run(wide);
  wide.root = 0;
  return wide;
}

}  // namespace perfect_bvh
