// Splits ranges by binned SAH (Wald 2007; lecture, "Rapid construction"). References are on a grid, and move from one
// array to the other as they are divided. In: references, settings (bins, axes, costs), and an optional limit up to
// which leaves are filled. Out: splits and leaves, in the form that top_down.h requires of a splitter.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "builders/agglomerative.h"
#include "builders/builder.h"
#include "builders/bvh2.h"
#include "builders/grid.h"
#include "builders/top_down.h"
#include "core/aligned.h"
#include "core/cancel.h"

namespace perfect_bvh {

struct GridRange : BuildRange {
  bool in_scratch = false;  // the rows are in the splitter's second array
  GridFrame frame;
};

class BinnedSplitter {
 public:
  using Range = GridRange;
  static constexpr std::uint32_t kSubtreeSize = 4096;

  // `config`, the token and the limit must outlive the splitter. With a limit, config.max_leaf_size must be 1.
  BinnedSplitter(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel,
                 const LeafLimit* leaf_limit = nullptr)
      : prims_(prims), config_(config), cancel_(cancel), leaf_limit_(leaf_limit) {
    memory_.expect(2 * prims.size() * sizeof(GridRef));
    refs_ = memory_.take<GridRef>(prims.size()), scratch_ = memory_.take<GridRef>(prims.size());
    root_.count = static_cast<std::uint32_t>(prims.size());
    AlignedVector<Box4> boxes(chunk_count_of(root_.count));
    for_rows(&pool, root_.count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      Box4 box = Box4::empty();
      for (std::size_t i = begin; i < end; ++i) box.grow(Box4::load(&prims_[i]));
      boxes[chunk] = box;
    });
    Box4 box = Box4::empty();
    for (const Box4& each : boxes) box.grow(each);
    root_.frame = GridFrame::around(box);
    for_rows(&pool, root_.count, [&](std::size_t, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        root_.frame.snap(Box4::load(&prims_[i]), static_cast<std::uint32_t>(i)).store(&refs_[i]);
      }
    });
  }

  // For ranges made from the input by other code, which may change the input until take_over().
  BinnedSplitter(std::span<const PrimRef> prims, const BuildConfig& config, CancelToken& cancel)
      : prims_(prims), config_(config), cancel_(cancel), leaf_limit_(nullptr) {
    memory_.expect(2 * prims.size() * sizeof(GridRef));
    refs_ = memory_.take<GridRef>(prims.size()), scratch_ = memory_.take<GridRef>(prims.size());
  }

  // Takes over the rows of a range, whose boxes are in `box`. May run on many threads at once, for disjoint ranges.
  void take_over(Range& range, const Box4& box) noexcept {
    range.in_scratch = false;
    range.frame = GridFrame::around(box);
    for (std::uint32_t i = range.begin; i < range.begin + range.count; ++i) {
      range.frame.snap(Box4::load(&prims_[i]), i).store(&refs_[i]);
    }
  }

  [[nodiscard]] const Range& root() const noexcept { return root_; }

  BinnedSplitter& enter_subtree(const Range&) noexcept { return *this; }

  void split_large(Range& range, Range& left, Range& right, ThreadPool* pool) { (void)split(range, left, right, pool); }

  bool split(Range& range, Range& left, Range& right, ThreadPool* pool = nullptr) {
    if (range.count == 1 || fills_leaf(range)) return false;
    if (pool != nullptr && range.count < kParallelSize) pool = nullptr;
    const bool is_few = range.count <= (config_.axes == 3 ? kFewBoxes : kFewestBoxes);
    const GridBounds bounds = measure(range, pool);
    const auto area = static_cast<float>(half_area(bounds.box));
    bool is_split = false;
    if (area > 0.0f && depth_allows_any_split(range)) {
      is_split = is_few ? split_by_sides(range, area, left, right) : split_by_plane(range, bounds, left, right, pool);
    }
    if (!is_split && range.count > config_.max_leaf_size) {
      split_in_halves(range, measure_finely(range, pool), left, right);
      is_split = true;
    }
    left.frame = right.frame = range.frame;
    if (is_split && range.count > kFewToFetch) {
      if (left.count <= kFewToFetch) fetch(left);
      if (right.count <= kFewToFetch) fetch(right);
    }
    return is_split;
  }

  Box4 write_leaf(const Range& range, std::uint32_t* prim_indices) const noexcept {
    const GridRef* from = rows(range, range.in_scratch);
    Box4 box = Box4::empty();
    for (std::uint32_t i = 0; i < range.count; ++i) {
      const PrimRef& prim = prims_[from[i].position()];
      prim_indices[i] = prim.prim_index;
      box.grow(Box4::load(&prim));
    }
    const Float4 zero(0.0f);  // -0 + 0 is +0
    return {box.lower + zero, box.upper + zero};
  }

  // Returns a range's rows; their positions are those in the input.
  [[nodiscard]] std::span<const GridRef> refs(const Range& range) const noexcept {
    return {rows(range, range.in_scratch), range.count};
  }

 private:
  // The minimum number of references bounded and put into bins; of larger ranges every second, third ... is taken.
  // Planes chosen from this many are as good, and the upper levels take a third of the time.
  static constexpr std::uint32_t kSampleSize = 2048;
  static constexpr std::uint32_t kSampleSizeForLeaves = 1024;   // with a limit: half as many give as few node visits
  static constexpr std::uint32_t kParallelSize = 65536;         // from this size on, threads share a node's work
  static constexpr std::uint32_t kChunk = kItemsBetweenAsking;  // references that a thread then takes at a time
  static_assert(std::has_single_bit(kChunk));
  static constexpr std::uint32_t kFewestBoxes = 4;
  static constexpr std::uint32_t kFewToFetch = 32;  // references whose primitives are prefetched
  static constexpr std::uint32_t kAhead = 16;       // prefetch distance in a loop through all
  // Up to this size a split decides how well leaves are filled. Measured: counting leaves makes 6 to 11% fewer of them,
  // at the same cost to rays; counting them in larger ranges gains no more.
  static constexpr std::uint32_t kMostToCountLeavesOf = 32;

  // Calls body(chunk, begin, end) for the chunks of [0, count), on the pool if there is one.
  template <class Body>
  void for_rows(ThreadPool* pool, std::uint32_t count, const Body& body) {
    const auto run = [&](std::size_t begin, std::size_t end) { body(begin / kChunk, begin, end); };
    if (pool != nullptr) return for_chunks(*pool, count, kChunk, cancel_, run);
    for_steps(count, cancel_, run);
  }

  [[nodiscard]] GridRef* rows(const Range& range, bool in_scratch) noexcept {
    return (in_scratch ? scratch_ : refs_).data() + range.begin;
  }
  [[nodiscard]] const GridRef* rows(const Range& range, bool in_scratch) const noexcept {
    return (in_scratch ? scratch_ : refs_).data() + range.begin;
  }

  static void set_rows(const Range& range, std::uint32_t left_count, bool in_scratch, Range& left,
                       Range& right) noexcept {
    divide_rows(range, left_count, left, right);
    left.in_scratch = right.in_scratch = in_scratch;
  }

  // Prefetches the data for the range's leaves, while the range is divided further.
  [[gnu::always_inline]] void fetch(const Range& range) const noexcept {
    for (const GridRef& ref : refs(range)) {
      __builtin_prefetch(&prims_[ref.position()]);
      if (leaf_limit_ != nullptr) leaf_limit_->fetch(ref.position());  // usually this is the primitive's number, too
    }
  }

  [[nodiscard]] bool fills_leaf(const Range& range) const noexcept {
    if (leaf_limit_ == nullptr || range.count > LeafLimit::kMost) return false;
    std::array<std::uint32_t, LeafLimit::kMost> numbers;
    const GridRef* from = rows(range, range.in_scratch);
    for (std::uint32_t i = 0; i < range.count; ++i) numbers[i] = prims_[from[i].position()].prim_index;
    return leaf_limit_->fits({numbers.data(), range.count});
  }

  // Returns the stride at which `count` references are sampled: see kSampleSize.
  [[nodiscard]] std::uint32_t sample_stride(std::uint32_t count) const noexcept {
    return std::max(1u, count / (leaf_limit_ != nullptr ? kSampleSizeForLeaves : kSampleSize));
  }

  // Returns the bounds of the sample, in a frame that is fine enough for it.
  GridBounds measure(Range& range, ThreadPool* pool) {
    const std::uint32_t stride = sample_stride(range.count);
    if (stride == 1) return measure_finely(range, pool);
    const GridRef* refs = rows(range, range.in_scratch);
    GridBounds bounds;
    for (std::size_t i = 0; i < range.count; i += stride) bounds.grow(Short8::load(&refs[i]));
    return longest_extent(bounds.box) >= kCoarseSteps ? bounds : measure_finely(range, pool);
  }

  // Returns the bounds of a range. If its present frame is too coarse, snaps it to its own frame first.
  GridBounds measure_finely(Range& range, ThreadPool* pool) {
    const GridRef* refs = rows(range, range.in_scratch);
    const GridBounds bounds = gather(range.count, pool, [&](std::size_t i) { return Short8::load(&refs[i]); });
    if (longest_extent(bounds.box) >= kCoarseSteps) return bounds;
    const GridFrame frame = range.frame.around(bounds.box);
    if (frame.steps == range.frame.steps) return bounds;
    range.frame = frame;
    return gather(range.count, pool, [&, to = rows(range, range.in_scratch)](std::size_t i) {
      // Stays within the chunk: other threads write theirs.
      const std::size_t ahead = std::min<std::size_t>({i + kAhead, i | (kChunk - 1), range.count - 1});
      __builtin_prefetch(&prims_[to[ahead].position()]);
      const std::uint32_t position = to[i].position();
      const GridBox box = frame.snap(Box4::load(&prims_[position]), position);
      box.store(&to[i]);
      return box;
    });
  }

  template <class BoxOf>
  GridBounds gather(std::uint32_t count, ThreadPool* pool, const BoxOf& box_of) {
    GridBounds all;
    const auto grow = [&](std::size_t begin, std::size_t end) {
      GridBounds bounds = all;  // in registers
      for (std::size_t i = begin; i < end; ++i) bounds.grow(box_of(i));
      all = bounds;
    };
    if (count <= kChunk) {
      grow(0, count);
      return all;
    }
    if (pool == nullptr) {
      for_steps(count, cancel_, grow);
      return all;
    }
    AlignedVector<GridBounds> chunks(chunk_count_of(count));
    for_rows(pool, count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      GridBounds bounds;
      for (std::size_t i = begin; i < end; ++i) bounds.grow(box_of(i));
      chunks[chunk] = bounds;
    });
    for (const GridBounds& chunk : chunks) all.grow(chunk);
    return all;
  }

  // Makes the best split of a few boxes, over all sides or planes.
  bool split_by_sides(const Range& range, float area, Range& left, Range& right) noexcept {
    std::array<GridBox, kFewBoxes> boxes;
    GridRef* refs = rows(range, range.in_scratch);
    for (std::uint32_t i = 0; i < range.count; ++i) boxes[i] = Short8::load(&refs[i]);
    const std::uint32_t is_left = split_few(boxes.data(), range.count, area, config_);
    if (is_left == 0) return false;
    std::uint32_t left_count = 0;
    for (std::uint32_t i = 0; i < range.count; ++i) left_count += (is_left >> i) & 1u;
    std::array<GridRef*, 2> to{refs + left_count, refs};
    for (std::uint32_t i = 0; i < range.count; ++i) boxes[i].store(to[(is_left >> i) & 1u]++);
    set_rows(range, left_count, range.in_scratch, left, right);
    return true;
  }

  // Splits at the cheapest plane between bins, if it costs less than the leaf or a leaf is not possible.
  bool split_by_plane(const Range& range, const GridBounds& bounds, Range& left, Range& right, ThreadPool* pool) {
    const std::uint32_t stride = sample_stride(range.count);
    const std::uint32_t count = (range.count + stride - 1) / stride;
    const std::uint32_t bin_count = std::min(config_.bins, count / 2 + 4);  // few references need few planes
    const int only_axis = config_.axes == 1 ? bounds.longest_axis() : -1;
    const BinMap map(bounds, bin_count);
    GridBins bins(bin_count);
    bins.add(rows(range, range.in_scratch), range.count, stride, map, only_axis);
    const bool counts_leaves = leaf_limit_ != nullptr && range.count <= kMostToCountLeavesOf;
    const Plane plane = bins.find_best(count, only_axis, counts_leaves ? Counting::kLeaves : Counting::kEach);
    if (plane.bin == 0) return false;
    if (range.count <= config_.max_leaf_size) {
      const auto area = static_cast<float>(half_area(bounds.box));
      const float split_cost = config_.traversal_cost * area + config_.intersection_cost * plane.cost;
      if (!(split_cost < config_.intersection_cost * area * static_cast<float>(count))) return false;
    }
    const std::uint32_t left_count = move_to_sides(range, plane.axis, map.border(plane.axis, plane.bin), pool);
    set_rows(range, left_count, !range.in_scratch, left, right);
    return true;
  }

  // Moves references to the other array: the left side from the front, the right side from the back.
  std::uint32_t move_to_sides(const Range& range, std::uint32_t axis, std::int32_t border, ThreadPool* pool) {
    const GridRef* from = rows(range, range.in_scratch);
    GridRef* to = rows(range, !range.in_scratch);
    if (range.count <= kChunk) {
      return static_cast<std::uint32_t>(partition(from, range.count, axis, border, to, to + range.count - 1));
    }
    if (pool == nullptr) {
      std::size_t left = 0;
      for_steps(range.count, cancel_, [&](std::size_t begin, std::size_t end) {
        GridRef* const last_free = to + range.count - 1 - (begin - left);
        left += partition(from + begin, end - begin, axis, border, to + left, last_free);
      });
      return static_cast<std::uint32_t>(left);
    }
    // The number of left references before each chunk gives the position where one thread would have put its rows.
    std::vector<std::size_t> left_before(chunk_count_of(range.count) + 1, 0);
    for_rows(pool, range.count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      std::size_t count = 0;
      for (std::size_t i = begin; i < end; ++i) count += is_left_of(from[i], axis, border);
      left_before[chunk + 1] = count;
    });
    for (std::size_t i = 1; i < left_before.size(); ++i) left_before[i] += left_before[i - 1];
    for_rows(pool, range.count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      const std::size_t right_before = begin - left_before[chunk];
      partition(from + begin, end - begin, axis, border, to + left_before[chunk], to + range.count - 1 - right_before);
    });
    return static_cast<std::uint32_t>(left_before.back());
  }

  // Fallback if the SAH decides nothing (all centroids equal, no area) or the maximum depth is near.
  void split_in_halves(const Range& range, const GridBounds& bounds, Range& left, Range& right) {
    GridRef* refs = rows(range, range.in_scratch);
    const std::uint32_t half = range.count / 2;
    if (bounds.has_spread()) {
      put_least_first({refs, range.count}, half, static_cast<std::size_t>(bounds.longest_axis()), cancel_);
    }
    set_rows(range, half, range.in_scratch, left, right);
  }

  std::span<const PrimRef> prims_;
  const BuildConfig& config_;
  CancelToken& cancel_;
  const LeafLimit* leaf_limit_;  // null: leaves by cost
  Scratch memory_;
  std::span<GridRef> refs_, scratch_;
  Range root_;
};

}  // namespace perfect_bvh
