#include "builders/builder.h"

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <string>
#include <utility>

#include "builders/binned_splitter.h"
#include "builders/optimize.h"
#include "builders/top_down.h"
#include "core/cancel.h"
#include "core/errors.h"

namespace perfect_bvh {
namespace {

void require(bool holds, const char* setting, const char* expected, double got) {
  if (holds) return;
  throw InvalidArgument(std::string("BuildConfig: ") + setting + " must be " + expected + ", got " +
                        std::to_string(got));
}

void check(const BuildConfig& config) {
  require(config.bins >= 2 && config.bins <= 256, "bins", "from 2 to 256", config.bins);
  require(config.axes == 1 || config.axes == 3, "axes", "1 or 3", config.axes);
  require(config.max_leaf_size >= 1 && config.max_leaf_size <= 255, "max_leaf_size", "from 1 to 255",
          config.max_leaf_size);
  require(config.traversal_cost >= 0 && config.traversal_cost <= 1e6f, "traversal_cost", "from 0 to 1e6",
          static_cast<double>(config.traversal_cost));
  require(config.intersection_cost >= 1e-6f && config.intersection_cost <= 1e6f, "intersection_cost",
          "from 1e-6 to 1e6", static_cast<double>(config.intersection_cost));
  require(config.duplication_budget >= 0 && config.duplication_budget <= 10, "duplication_budget", "from 0 to 10",
          static_cast<double>(config.duplication_budget));
}

Bvh2 build_unoptimized(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel,
                       const PrimClipper* clipper, const LeafLimit* leaf_limit) {
  switch (config.builder) {
    case BuilderKind::kAuto:
    case BuilderKind::kBinned:
      return build_binned(prims, config, pool, cancel, config.fills_leaves ? leaf_limit : nullptr);
    case BuilderKind::kMedian:
      return build_median(prims, config, pool, cancel);
    case BuilderKind::kSweep:
      return build_sweep(prims, config, pool, cancel);
    case BuilderKind::kFast:
      return build_fast(prims, config, pool, cancel);
    case BuilderKind::kSpatial:
      return build_spatial(prims, config, clipper, pool, cancel);
  }
  throw InvalidArgument("BuildConfig: this builder is not available");
}

}  // namespace

BuilderKind find_builder(std::string_view name) {
  for (const BuilderName& builder : kBuilders) {
    if (name == builder.name) return builder.kind;
  }
  throw InvalidArgument("BuildConfig: unknown builder '" + std::string(name) + "'");
}

Bvh2 build_bvh2(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel,
                const PrimClipper* clipper, const LeafLimit* leaf_limit) {
  check(config);
  constexpr std::size_t kMaxPrims = std::numeric_limits<std::int32_t>::max();  // node indices have 32 bits
  if (prims.size() > kMaxPrims) {
    throw InvalidArgument("build_bvh2: expected at most 2147483647 primitives, got " + std::to_string(prims.size()));
  }
  if (prims.empty()) return {};
  Bvh2 tree = build_unoptimized(prims, config, pool, cancel, clipper, leaf_limit);
  if (config.optimize_passes > 0) optimize_bvh2(tree, config.optimize_passes, pool, cancel);
  return tree;
}

// Binned --------------------------------------------------------------------------------------------------------------
// Binned SAH construction (Wald 2007, "On fast construction of SAH-based bounding volume hierarchies"; lecture, "Rapid
// construction": planes independent of N).
// In: references, settings (bins, axes, costs). Out: a refittable tree with leaves where no split pays off, or where
// primitives fit into one leaf of the wide tree.

namespace {

BuildConfig down_to_single_primitives(BuildConfig config) noexcept {
  config.max_leaf_size = 1;
  config.traversal_cost = config.intersection_cost = 1.0f;
  return config;
}

}  // namespace

Bvh2 build_binned(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel,
                  const LeafLimit* leaf_limit) {
  const BuildConfig used = leaf_limit != nullptr ? down_to_single_primitives(config) : config;
  BinnedSplitter splitter(prims, used, pool, cancel, leaf_limit);
  Bvh2 tree = TopDownBuilder(splitter, pool, cancel).build(splitter.root());
  tree.has_full_leaves = leaf_limit != nullptr;
  return tree;
}

// Median --------------------------------------------------------------------------------------------------------------
// The naive reference: halves of equal size, divided at the median centroid on the axis where the centroids spread most
// (lecture, "Naive against SAH"). It ignores costs; leaves have a fixed size.
// In: references. Out: a refittable tree of the least depth.

namespace {

class MedianSplitter {
 public:
  using Range = BuildRange;
  static constexpr std::uint32_t kSubtreeSize = 4096;

  MedianSplitter(std::span<const PrimRef> prims, const BuildConfig& config, CancelToken& cancel)
      : leaf_size_(config.max_leaf_size), cancel_(cancel), refs_(prims.size()) {
    for_steps(prims.size(), cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) refs_[i] = prims[i];
    });
  }

  [[nodiscard]] Range root() const noexcept { return {0, static_cast<std::uint32_t>(refs_.size()), 0}; }
  MedianSplitter& enter_subtree(const Range&) noexcept { return *this; }

  void split_large(const Range& range, Range& left, Range& right, ThreadPool*) { (void)split(range, left, right); }

  bool split(const Range& range, Range& left, Range& right) {
    if (range.count <= leaf_size_) return false;
    const std::uint32_t half = range.count / 2;
    PrimRef* refs = refs_.data() + range.begin;
    const int axis = widest_axis({refs, range.count});
    const auto key = [axis](const PrimRef& ref) {
      return std::pair(ref.lower[axis] + ref.upper[axis], ref.prim_index);
    };
    select_nth(std::span(refs, range.count), half, cancel_,
               [&](const PrimRef& a, const PrimRef& b) { return key(a) < key(b); });
    divide_rows(range, half, left, right);
    return true;
  }

  Box4 write_leaf(const Range& range, std::uint32_t* prim_indices) const noexcept {
    Box4 box = Box4::empty();
    for (std::uint32_t i = 0; i < range.count; ++i) {
      const PrimRef& ref = refs_[range.begin + i];
      prim_indices[i] = ref.prim_index;
      box.grow(Box4::load(&ref));
    }
    // Sorted because C++ libraries differ in the order that selection leaves within a half.
    std::sort(prim_indices, prim_indices + range.count);
    const Float4 zero(0.0f);  // -0 + 0 is +0
    return {box.lower + zero, box.upper + zero};
  }

 private:
  [[nodiscard]] int widest_axis(std::span<const PrimRef> refs) {
    Box4 centroids = Box4::empty();
    const auto grow = [&](std::size_t begin, std::size_t end) {
      Box4 box = centroids;  // in registers
      for (std::size_t i = begin; i < end; ++i) box.grow(Float4::load(&refs[i].lower) + Float4::load(&refs[i].upper));
      centroids = box;
    };
    if (refs.size() <= kItemsBetweenAsking) {
      grow(0, refs.size());
    } else {
      for_steps(refs.size(), cancel_, grow);
    }
    alignas(16) std::array<float, 4> spread;
    centroids.extent().store(spread.data());
    return static_cast<int>(std::max_element(spread.begin(), spread.begin() + 3) - spread.begin());
  }

  const std::uint32_t leaf_size_;
  CancelToken& cancel_;
  AlignedVector<PrimRef> refs_;
};

}  // namespace

Bvh2 build_median(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  MedianSplitter splitter(prims, config, cancel);
  return TopDownBuilder(splitter, pool, cancel).build(splitter.root());
}

}  // namespace perfect_bvh
