// The naive reference: halves of equal size, divided at the median centroid on the axis where the centroids spread
// most (lecture, "Naive against SAH"). No cost is looked at; leaves have a fixed size.
// In: references. Out: a refittable tree of the least depth.

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "builders/builders.h"
#include "builders/select_nth.h"
#include "builders/top_down.h"
#include "core/steps.h"

namespace perfect_bvh {
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
    // C++ libraries differ in the order that selection leaves within a half.
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
