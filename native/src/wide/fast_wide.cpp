#include "wide/fast_wide.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "builders/locally_ordered.h"
#include "core/steps.h"
#include "wide/cluster_plan.h"
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

struct Nodes {
  AlignedVector<WideNode> rows;
  std::uint32_t depth = 0;
};

// Writes wide nodes as planned, depth first.
class Writer {
 public:
  Writer(const ClusterTree& tree, const AlignedVector<PlacesPlan>& plans) noexcept
      : tree_(tree), plans_(plans), leaf_count_(tree.box_count) {}

  // Everything below `root`; clusters numbered below `end` are left to others and added to `left`.
  void write(const Child& root, std::uint32_t end, Nodes& nodes, std::vector<Child>& left, CancelToken& cancel) {
    waiting_.assign(1, root);
    for (Steps steps(cancel); !waiting_.empty(); steps.step()) {
      const Child now = waiting_.back();
      waiting_.pop_back();
      const auto row = static_cast<std::uint32_t>(nodes.rows.size());
      if (now.row != kNoParent) nodes.rows[now.row].child[now.lane] = row;
      nodes.depth = std::max(nodes.depth, now.depth);
      write_node(now.cluster, nodes.rows.emplace_back());
      for (std::uint32_t lane = count_; lane-- > 0;) {
        if (children_[lane] < leaf_count_) continue;
        const Child child{children_[lane], row, lane, now.depth + 1};
        (child.cluster < end ? left : waiting_).push_back(child);
      }
    }
  }

  static constexpr std::uint32_t kNoParent = ~0u;  // as `row`: a root

 private:
  void write_node(std::uint32_t cluster, WideNode& node) noexcept {
    count_ = 0;
    const std::uint32_t to_left = plans_[cluster - leaf_count_].to_left(1);
    spread(tree_.clusters[cluster].left, to_left);
    spread(tree_.clusters[cluster].right, kWideWidth - to_left);
    std::array<Box4, kWideWidth> boxes;
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      const bool is_taken = lane < count_;
      boxes[lane] = is_taken ? tree_.clusters[children_[lane]].box() : Box4::empty();
      node.child[lane] = is_taken && children_[lane] < leaf_count_ ? kBlockChild + children_[lane] : kNoChild;
    }
    write_planes(boxes.data(), node);
    set_visit_order(node, count_);
  }

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
  const AlignedVector<PlacesPlan>& plans_;
  std::uint32_t leaf_count_;
  std::vector<Child> waiting_;
  std::array<std::uint32_t, kWideWidth> children_;
  std::uint32_t count_ = 0;
};

// Subtrees are written by several threads into arrays of their own, and these strung together.
class Assembly {
 public:
  Assembly(const ClusterTree& tree, const AlignedVector<PlacesPlan>& plans, ThreadPool& pool, CancelToken& cancel)
      : tree_(tree), plans_(plans), pool_(pool), cancel_(cancel) {}

  void run(WideBvh& wide) {
    Nodes upper;
    Writer(tree_, plans_).write({tree_.root, Writer::kNoParent, 0, 1}, tree_.top.begin, upper, subtrees_, cancel_);
    std::vector<Nodes> groups((subtrees_.size() + kGroup - 1) / kGroup);
    std::vector<std::uint32_t> rows(subtrees_.size());  // of a subtree's root in its group
    for_chunks(pool_, subtrees_.size(), kGroup, cancel_, [&](std::size_t begin, std::size_t end) {
      Nodes& group = groups[begin / kGroup];
      Writer writer(tree_, plans_);
      std::vector<Child> none;
      for (std::size_t i = begin; i < end; ++i) {
        rows[i] = static_cast<std::uint32_t>(group.rows.size());
        writer.write({subtrees_[i].cluster, Writer::kNoParent, 0, subtrees_[i].depth}, 0, group, none, cancel_);
      }
    });
    std::vector<std::size_t> first_rows(groups.size() + 1, upper.rows.size());
    wide.depth = upper.depth;
    for (std::size_t i = 0; i < groups.size(); ++i) {
      first_rows[i + 1] = first_rows[i] + groups[i].rows.size();
      wide.depth = std::max(wide.depth, groups[i].depth);
    }
    for_steps(subtrees_.size(), cancel_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        upper.rows[subtrees_[i].row].child[subtrees_[i].lane] =
            static_cast<std::uint32_t>(first_rows[i / kGroup]) + rows[i];
      }
    });
    wide.nodes.resize(first_rows.back());
    for_steps(upper.rows.size(), cancel_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) wide.nodes[i] = upper.rows[i];
    });
    for_chunks(pool_, groups.size(), 1, cancel_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        copy(groups[i], static_cast<std::uint32_t>(first_rows[i]), wide);
        groups[i] = {};
      }
    });
  }

 private:
  static constexpr std::size_t kGroup = 64;  // subtrees

  // No node refers to row 0 of its group, a root: there, too, 0 stands for an empty place.
  static void copy(const Nodes& group, std::uint32_t first_row, WideBvh& wide) noexcept {
    WideNode* to = &wide.nodes[first_row];
    for (const WideNode& node : group.rows) {
      *to = node;
      for (std::uint32_t& child : to->child) child += child != kNoChild && child < kBlockChild ? first_row : 0;
      ++to;
    }
  }

  const ClusterTree& tree_;
  const AlignedVector<PlacesPlan>& plans_;
  ThreadPool& pool_;
  CancelToken& cancel_;
  std::vector<Child> subtrees_;
};

}  // namespace

WideBvh build_fast_wide(const TriangleMesh& mesh, TreeLayout layout, ThreadPool& pool, CancelToken& cancel) {
  WideBvh wide;
  wide.layout = layout;
  if (mesh.triangle_count() == 0) return wide;
  MortonLeaves leaves = make_morton_leaves(mesh, layout, pool, cancel);
  wide.is_empty = false;
  wide.scale = leaves.scale;
  wide.extent = tree_extent(leaves.bounds, leaves.scale);
  wide.blocks = std::move(leaves.blocks);
  wide.indexed_leaves = std::move(leaves.indexed_leaves);
  if (wide.leaf_count() == 1) {
    wide.root = kBlockChild;
    return wide;
  }
  const ClusterTree tree = cluster_along_curve(std::move(leaves.boxes), pool, cancel);
  const auto plans = plan_places(tree, pool, cancel);
  Assembly(tree, plans, pool, cancel).run(wide);
  wide.root = 0;
  return wide;
}

}  // namespace perfect_bvh
