// Construction for topology that changes every frame (lecture, "Rapid construction"): binned SAH over clusters of a few
// neighbours along a Morton curve (Garanzha et al. 2011), then the best splits inside them. A fifth of the references
// to bin, at nearly the same cost of the tree. In: references, settings (bins, axes, costs). Out: a refittable tree
// with leaves where no split pays.

#include <array>
#include <cstdint>

#include "builders/binned_splitter.h"
#include "builders/builders.h"
#include "builders/few_boxes.h"
#include "builders/grid_ref.h"
#include "builders/morton_clusters.h"
#include "builders/top_down.h"
#include "core/steps.h"

namespace perfect_bvh {
namespace {

// Counted in references; first over whole clusters, then, from kFewBoxes references on down, over single ones.
struct FastRange : BuildRange {
  GridRange clusters;      // of the binned splitter
  bool is_single = false;  // the rows stand in FastSplitter's own array
};

[[nodiscard]] BuildConfig down_to_single_clusters(BuildConfig config) noexcept {
  config.max_leaf_size = 1;
  return config;
}

class FastSplitter {
 public:
  using Range = FastRange;
  static constexpr std::uint32_t kSubtreeSize = 8192;

  FastSplitter(const MortonClusters& clusters, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel)
      : clusters_(clusters),
        config_(config),
        cancel_(cancel),
        cluster_config_(down_to_single_clusters(config)),
        binned_(clusters.boxes, cluster_config_, pool, cancel),
        refs_(clusters.prims.size()) {
    root_.count = static_cast<std::uint32_t>(clusters.prims.size());
    root_.clusters = binned_.root();
    root_.clusters.depth = kLevelsOfCluster;
  }

  [[nodiscard]] const Range& root() const noexcept { return root_; }
  FastSplitter& enter_subtree(const Range&) noexcept { return *this; }

  void split_large(Range& range, Range& left, Range& right, ThreadPool* pool) {
    split_clusters(range, left, right, pool);
  }

  bool split(Range& range, Range& left, Range& right) {
    if (range.is_single) return split_single(range, left, right);
    if (range.count <= kFewBoxes) {
      take_apart(range);
      return split_single(range, left, right);
    }
    split_clusters(range, left, right, nullptr);
    return range.count > config_.max_leaf_size || is_worth_it(range, left, right);
  }

  Box4 write_leaf(const Range& range, std::uint32_t* prim_indices) const noexcept {
    Box4 box = Box4::empty();
    const auto add = [&](const PrimRef& prim) {
      *prim_indices++ = prim.prim_index;
      box.grow(Box4::load(&prim));
    };
    if (range.is_single) {
      for (std::uint32_t i = 0; i < range.count; ++i) add(clusters_.prims[refs_[range.begin + i].position()]);
    } else {
      for_prims(range.clusters, [&](std::uint32_t row) { add(clusters_.prims[row]); });
    }
    const Float4 zero(0.0f);  // -0 + 0 is +0
    return {box.lower + zero, box.upper + zero};
  }

 private:
  // Levels that halving a cluster takes: the binned splitter keeps them free below its own.
  static constexpr std::uint32_t kLevelsOfCluster = 4;

  template <class Body>
  void for_prims(const GridRange& range, const Body& body) const {
    for (const GridRef& ref : binned_.refs(range)) {
      const ClusterRows rows = clusters_.rows[ref.position()];
      for (std::uint32_t i = 0; i < rows.count; ++i) body(rows.first + i);
    }
  }

  void split_clusters(Range& range, Range& left, Range& right, ThreadPool* pool) {
    (void)binned_.split(range.clusters, left.clusters, right.clusters, pool);  // two clusters at least: it must
    const bool left_is_smaller = left.clusters.count <= right.clusters.count;
    std::uint32_t count = 0;
    const std::span<const GridRef> refs = binned_.refs(left_is_smaller ? left.clusters : right.clusters);
    const auto add = [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) count += clusters_.rows[refs[i].position()].count;
    };
    if (refs.size() <= kItemsBetweenAsking) {
      add(0, refs.size());
    } else {
      for_steps(refs.size(), cancel_, add);
    }
    set_rows(range, left_is_smaller ? count : range.count - count, left, right);
  }

  static void set_rows(const Range& range, std::uint32_t left_count, Range& left, Range& right) noexcept {
    divide_rows(range, left_count, left, right);
    left.is_single = right.is_single = range.is_single;
  }

  // Whether a split costs less than a leaf; for leaves larger than a cluster.
  [[nodiscard]] bool is_worth_it(const Range& range, const Range& left, const Range& right) const noexcept {
    Box4 left_box = bounds(left.clusters);
    const Box4 right_box = bounds(right.clusters);
    const float parts = half_area(left_box.extent()) * static_cast<float>(left.count) +
                        half_area(right_box.extent()) * static_cast<float>(right.count);
    left_box.grow(right_box);
    const float area = half_area(left_box.extent());
    return config_.traversal_cost * area + config_.intersection_cost * parts <
           config_.intersection_cost * area * static_cast<float>(range.count);
  }

  [[nodiscard]] Box4 bounds(const GridRange& range) const noexcept {
    Box4 box = Box4::empty();
    for (const GridRef& ref : binned_.refs(range)) box.grow(Box4::load(&clusters_.boxes[ref.position()]));
    return box;
  }

  // From clusters to single references, on a grid of their own size.
  void take_apart(Range& range) noexcept {
    Box4 box = Box4::empty();
    for (const GridRef& ref : binned_.refs(range.clusters)) box.grow(Box4::load(&clusters_.boxes[ref.position()]));
    const GridFrame frame = range.clusters.frame.around_part(box);
    GridRef* to = &refs_[range.begin];
    for_prims(range.clusters,
              [&](std::uint32_t row) { frame.snap(Box4::load(&clusters_.prims[row]), row).store(to++); });
    range.is_single = true;
  }

  // The best of all sides or planes that a few references can take.
  bool split_single(const Range& range, Range& left, Range& right) noexcept {
    if (range.count == 1) return false;
    GridRef* refs = &refs_[range.begin];
    std::array<GridBox, kFewBoxes> boxes;
    GridBox all = empty_grid_box();
    for (std::uint32_t i = 0; i < range.count; ++i) {
      boxes[i] = Short8::load(&refs[i]);
      all = min(all, boxes[i]);
    }
    const auto area = static_cast<float>(half_area(all));
    std::uint32_t is_left = 0;
    if (area > 0.0f && depth_allows_any_split(range)) is_left = split_few(boxes.data(), range.count, area, config_);
    if (is_left == 0) {
      if (range.count <= config_.max_leaf_size) return false;
      is_left = (1u << (range.count / 2)) - 1;  // nothing to choose by
    }
    std::uint32_t left_count = 0;
    for (std::uint32_t i = 0; i < range.count; ++i) left_count += (is_left >> i) & 1u;
    std::array<GridRef*, 2> to{refs + left_count, refs};
    for (std::uint32_t i = 0; i < range.count; ++i) boxes[i].store(to[(is_left >> i) & 1u]++);
    set_rows(range, left_count, left, right);
    return true;
  }

  const MortonClusters& clusters_;
  const BuildConfig& config_;
  CancelToken& cancel_;
  const BuildConfig cluster_config_;
  BinnedSplitter binned_;
  AlignedVector<GridRef> refs_;  // single references; their positions are rows of clusters_.prims
  Range root_;
};

}  // namespace

Bvh2 build_fast(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  const MortonClusters clusters = make_morton_clusters(prims, pool, cancel);
  FastSplitter splitter(clusters, config, pool, cancel);
  return TopDownBuilder(splitter, pool, cancel).build(splitter.root());
}

}  // namespace perfect_bvh
