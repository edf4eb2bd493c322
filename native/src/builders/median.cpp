// The naive reference: halves of equal size, divided at the median centroid on the axis where the centroids spread
// most (lecture, "Naive against SAH"). No cost is looked at; leaves have a fixed size.
// In: references. Out: a refittable tree of the least depth.

#include <algorithm>
#include <array>
#include <utility>

#include "builders/builders.h"
#include "builders/top_down.h"

namespace perfect_bvh {
namespace {

class MedianSplitter {
 public:
  using Range = BuildRange;
  static constexpr std::uint32_t kSubtreeSize = 4096;

  MedianSplitter(std::span<const PrimRef> prims, const BuildConfig& config)
      : leaf_size_(config.max_leaf_size), refs_(prims.begin(), prims.end()) {}

  [[nodiscard]] Range root() const noexcept { return {0, static_cast<std::uint32_t>(refs_.size()), 0}; }
  MedianSplitter& enter_subtree(const Range&) noexcept { return *this; }

  void split_large(const Range& range, Range& left, Range& right, ThreadPool*) { (void)split(range, left, right); }

  bool split(const Range& range, Range& left, Range& right) noexcept {
    if (range.count <= leaf_size_) return false;
    const std::uint32_t half = range.count / 2;
    PrimRef* refs = refs_.data() + range.begin;
    const int axis = widest_axis({refs, range.count});
    const auto key = [axis](const PrimRef& ref) {
      return std::pair(ref.lower[axis] + ref.upper[axis], ref.prim_index);
    };
    std::nth_element(refs, refs + half, refs + range.count,
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
    const Float4 zero(0.0f);  // -0 + 0 is +0
    return {box.lower + zero, box.upper + zero};
  }

 private:
  [[nodiscard]] static int widest_axis(std::span<const PrimRef> refs) noexcept {
    Box4 centroids = Box4::empty();
    for (const PrimRef& ref : refs) centroids.grow(Float4::load(&ref.lower) + Float4::load(&ref.upper));
    alignas(16) std::array<float, 4> spread;
    centroids.extent().store(spread.data());
    return static_cast<int>(std::max_element(spread.begin(), spread.begin() + 3) - spread.begin());
  }

  const std::uint32_t leaf_size_;
  AlignedVector<PrimRef> refs_;
};

}  // namespace

Bvh2 build_median(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  MedianSplitter splitter(prims, config);
  return TopDownBuilder(splitter, pool, cancel).build(splitter.root());
}

}  // namespace perfect_bvh
