// Builds a binary tree for topology that changes every frame (lecture, "Rapid construction"). Used if a binary tree is
// needed: for optimization, another leaf size or other costs. Boxes are sorted by their Morton codes and clustered
// along that curve (locally_ordered.h); clusters that cost less as a leaf become one. Builds without these needs go
// directly to the wide tree in the same way: wide/fast_wide.h. Binning over clusters of neighbours (Garanzha et al.
// 2011) made slightly better trees, in 2 to 3 times that time.
// In: references, settings (leaf size, costs). Out: a refittable tree with leaves where no split pays off.

#include <array>
#include <cstdint>

#include "builders/builder.h"
#include "builders/grid.h"
#include "builders/locally_ordered.h"
#include "builders/top_down.h"
#include "core/aligned.h"
#include "core/cancel.h"

namespace perfect_bvh {
namespace {

// The contents below a cluster. Uninitialized, because room for all of them is made at once.
struct Contents {
  std::uint32_t count;  // references
  float cost;
  bool is_leaf;
};

// Decides from the lower clusters upwards where a leaf costs no more than subdividing.
class LeafChoice {
 public:
  LeafChoice(const ClusterTree& tree, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel)
      : tree_(tree), config_(config), pairs_(tree.top.end - tree.box_count) {
    for_chunks(pool, tree.regions.size(), 1, cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) choose(tree.regions[i].begin, tree.regions[i].end);
    });
    for_steps(tree.top.end - tree.top.begin, cancel, [&](std::size_t begin, std::size_t end) {
      const std::uint32_t first = tree.top.begin;
      choose(first + static_cast<std::uint32_t>(begin), first + static_cast<std::uint32_t>(end));
    });
  }

  [[nodiscard]] Contents of(std::uint32_t cluster) const noexcept {
    if (cluster >= tree_.box_count) return pairs_[cluster - tree_.box_count];
    return {1, config_.intersection_cost * tree_.clusters[cluster].half_area(), true};
  }

 private:
  void choose(std::uint32_t begin, std::uint32_t end) noexcept {
    for (std::uint32_t i = begin; i < end; ++i) {
      const Cluster& pair = tree_.clusters[i];
      const Contents left = of(pair.left), right = of(pair.right);
      Contents& both = pairs_[i - tree_.box_count];
      both.count = left.count + right.count;
      const float area = pair.half_area();
      const float as_leaf = config_.intersection_cost * area * static_cast<float>(both.count);
      both.cost = config_.traversal_cost * area + (left.cost + right.cost);
      both.is_leaf = both.count <= config_.max_leaf_size && as_leaf <= both.cost;
      if (both.is_leaf) both.cost = as_leaf;
    }
  }

  const ClusterTree& tree_;
  const BuildConfig& config_;
  AlignedVector<Contents> pairs_;  // of clusters of two, by number minus the number of boxes
};

struct ClusterRange : BuildRange {
  std::uint32_t cluster = 0;
};

// Only replays the splits, which are already made.
class FastSplitter {
 public:
  using Range = ClusterRange;
  static constexpr std::uint32_t kSubtreeSize = 8192;

  FastSplitter(const Curve& curve, const LeafChoice& choice) noexcept : curve_(curve), choice_(choice) {}

  [[nodiscard]] Range root() const noexcept {
    Range root;
    root.cluster = curve_.tree().root;
    root.count = choice_.of(root.cluster).count;
    return root;
  }
  FastSplitter& enter_subtree(const Range&) noexcept { return *this; }

  void split_large(Range& range, Range& left, Range& right, ThreadPool*) noexcept {
    const Cluster& pair = curve_.tree().clusters[range.cluster];
    divide_rows(range, choice_.of(pair.left).count, left, right);
    left.cluster = pair.left, right.cluster = pair.right;
  }

  bool split(Range& range, Range& left, Range& right) noexcept {
    if (choice_.of(range.cluster).is_leaf) return false;
    split_large(range, left, right, nullptr);
    return true;
  }

  Box4 write_leaf(const Range& range, std::uint32_t* prim_indices) const noexcept {
    const ClusterTree& tree = curve_.tree();
    Box4 box = Box4::empty();
    std::array<std::uint32_t, kMaxTreeDepth + 1> stack;
    std::size_t stacked = 0;
    stack[stacked++] = range.cluster;
    while (stacked > 0) {
      const std::uint32_t cluster = stack[--stacked];
      if (cluster >= tree.box_count) {
        stack[stacked++] = tree.clusters[cluster].right;
        stack[stacked++] = tree.clusters[cluster].left;
        continue;
      }
      const PrimRef& prim = curve_.prim(cluster);
      *prim_indices++ = prim.prim_index;
      box.grow(Box4::load(&prim));
    }
    const Float4 zero(0.0f);  // -0 + 0 is +0
    return {box.lower + zero, box.upper + zero};
  }

 private:
  const Curve& curve_;
  const LeafChoice& choice_;
};

}  // namespace

Bvh2 build_fast(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  const auto scale_of = [](const Box4& bounds) { return GridFrame::around(bounds).multiplier; };
  Curve curve(prims, scale_of, pool, cancel);
  const LeafChoice choice(curve.tree(), config, pool, cancel);
  FastSplitter splitter(curve, choice);
  return TopDownBuilder(splitter, pool, cancel).build(splitter.root());
}

}  // namespace perfect_bvh
