// Full SAH construction: all 3(N-1) planes of every node (MacDonald and Booth 1990; lecture, "Candidates"), over
// references that are sorted once and stay sorted while they are divided (Wald 2007, "sweep").
// In: references, costs. Out: a refittable tree, the lowest cost that greedy object splits reach.

#include <algorithm>
#include <array>
#include <vector>

#include "builders/builder.h"
#include "builders/morton.h"
#include "builders/sweep_subtree.h"
#include "builders/top_down.h"
#include "core/cancel.h"

namespace perfect_bvh {
namespace {

struct Candidate {
  float cost;
  std::uint32_t left_count;  // 0: none
};

// The cheapest plane among references in one order, if it costs less than `limit`. The cost of a side only grows with
// its size, so each sweep can stop when its side alone reaches the limit.
class Sweep {
 public:
  Sweep(std::span<const GridRef> refs, float* right_costs, float limit) noexcept
      : refs_(refs), right_costs_(right_costs), limit_(limit) {}

  [[nodiscard]] Candidate run(CancelToken& cancel) {
    const std::size_t first = price_right_sides(cancel);
    GridBox box = empty_grid_box();
    for_steps(first, cancel, [&](std::size_t begin, std::size_t end) {
      GridBox grown = box;  // in a register
      for (const GridRef& ref : refs_.subspan(begin, end - begin)) grown = min(grown, Short8::load(&ref));
      box = grown;
    });
    return price_planes(first, box, cancel);
  }

 private:
  // Returns the first reference of the last side priced; smaller left sides need not be tried.
  [[nodiscard]] std::size_t price_right_sides(CancelToken& cancel) {
    GridBox box = empty_grid_box();
    std::size_t first = refs_.size() - 1;
    while (first > 0) {
      const std::size_t end = first - std::min(first, kItemsBetweenAsking);
      for (; first > end; --first) {
        box = min(box, Short8::load(&refs_[first]));
        right_costs_[first] = static_cast<float>(half_area(box)) * static_cast<float>(refs_.size() - first);
        if (right_costs_[first] >= limit_) return first;
      }
      cancel.checkpoint();
    }
    return 0;
  }

  // `box`: the box of the references before `first`.
  [[nodiscard]] Candidate price_planes(std::size_t first, GridBox box, CancelToken& cancel) {
    Candidate best{limit_, 0};
    for (std::size_t i = first + 1; i < refs_.size(); cancel.checkpoint()) {
      const std::size_t end = std::min(refs_.size(), i + kItemsBetweenAsking);
      for (; i < end; ++i) {
        box = min(box, Short8::load(&refs_[i - 1]));
        const float left_cost = static_cast<float>(half_area(box)) * static_cast<float>(i);
        if (left_cost >= best.cost) return best;
        const float cost = left_cost + right_costs_[i];
        if (cost < best.cost) best = {cost, static_cast<std::uint32_t>(i)};
      }
    }
    return best;
  }

  std::span<const GridRef> refs_;
  float* const right_costs_;
  const float limit_;
};

// Keeps three copies of the references, each in the order of one axis, so that sweeps read them sequentially.
class SweepSplitter {
 public:
  using Range = SweepRange;
  static constexpr std::uint32_t kSubtreeSize = 16384;

  SweepSplitter(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel)
      : prims_(prims), config_(config), cancel_(cancel), is_left_(prims.size()), number_of_(prims.size()) {
    for (auto& each : scratch_) each.resize(prims.size());
    Box4 box = Box4::empty();
    for_steps(prims.size(), cancel, [&](std::size_t begin, std::size_t end) {
      for (const PrimRef& prim : prims.subspan(begin, end - begin)) box.grow(Box4::load(&prim));
    });
    root_.count = static_cast<std::uint32_t>(prims.size());
    root_.frame = GridFrame::around(box);
    for_axes(&pool, [&](std::size_t axis) { sort(axis); });
  }

  [[nodiscard]] const Range& root() const noexcept { return root_; }

  SweepSubtree enter_subtree(const Range& range) {
    return {prims_, config_, range, {rows(range, 0), rows(range, 1), rows(range, 2)}, number_of_.data()};
  }

  void split_large(Range& range, Range& left, Range& right, ThreadPool* pool) {
    const GridBounds bounds = measure_finely(range);
    const auto area = static_cast<float>(half_area(bounds.box));
    auto axis = static_cast<std::size_t>(bounds.longest_axis());
    std::uint32_t left_count = range.count / 2;
    if (area > 0.0f && depth_allows_any_split(range)) {
      std::array<Candidate, 3> best;
      const float unsplit = area * static_cast<float>(range.count);
      for_axes(pool, [&](std::size_t a) {
        // The best cost on another axis limits the search, if it is already known; the result is the same.
        const float limit = pool == nullptr && a > 0 ? std::min(best[0].cost, best[a - 1].cost) : unsplit;
        best[a] = Sweep(rows(range, a), &costs_[a][range.begin], limit).run(cancel_);
      });
      const auto cheapest = static_cast<std::size_t>(
          std::min_element(best.begin(), best.end(), [](auto& a, auto& b) { return a.cost < b.cost; }) - best.begin());
      if (best[cheapest].left_count > 0) {
        axis = cheapest;
        left_count = best[cheapest].left_count;
      }
    }
    divide(range, axis, left_count, pool);
    left.frame = right.frame = range.frame;
    divide_rows(range, left_count, left, right);
  }

 private:
  [[nodiscard]] std::span<GridRef> rows(const Range& range, std::size_t axis) noexcept {
    return {sorted_[axis].data() + range.begin, range.count};
  }

  // Calls body(references) for parts of them, in the order of an axis.
  template <class Body>
  void for_rows(const Range& range, std::size_t axis, const Body& body) {
    const std::span<GridRef> refs = rows(range, axis);
    for_steps(refs.size(), cancel_,
              [&](std::size_t begin, std::size_t end) { body(refs.subspan(begin, end - begin)); });
  }

  template <class Body>
  void for_axes(ThreadPool* pool, const Body& body) {
    if (pool == nullptr) {
      for (std::size_t axis = 0; axis < 3; ++axis) body(axis);
      return;
    }
    for_chunks(*pool, 3, 1, cancel_, [&](std::size_t axis, std::size_t) { body(axis); });
  }

  void sort(std::size_t axis) {
    AlignedVector<std::uint64_t> keys(prims_.size()), scratch(prims_.size());
    const int a = static_cast<int>(axis);
    for_steps(keys.size(), cancel_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const float centroid = prims_[i].lower[a] + prims_[i].upper[a];
        keys[i] = (std::uint64_t{ordered_bits(centroid + 0.0f)} << 32) | i;
      }
    });
    sorted_[axis].resize(keys.size());
    costs_[axis].resize(keys.size());
    const std::span<const std::uint64_t> in_order = radix_sort(keys, scratch, 32, 32, cancel_);
    for_steps(in_order.size(), cancel_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t rank = begin; rank < end; ++rank) {
        const auto position = static_cast<std::uint32_t>(in_order[rank]);
        root_.frame.snap(Box4::load(&prims_[position]), position).store(&sorted_[axis][rank]);
      }
    });
  }

  // Returns the bounds of a range. If its present frame is too coarse, snaps it to its own frame first.
  GridBounds measure_finely(Range& range) {
    GridBounds bounds;
    for_rows(range, 0, [&](std::span<const GridRef> refs) {
      GridBounds grown = bounds;  // in registers
      for (const GridRef& ref : refs) grown.grow(Short8::load(&ref));
      bounds = grown;
    });
    if (longest_extent(bounds.box) >= kCoarseSteps) return bounds;
    const GridFrame frame = range.frame.around(bounds.box);
    if (frame.steps == range.frame.steps) return bounds;
    range.frame = frame;
    bounds = {};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for_rows(range, axis, [&](std::span<GridRef> refs) {
        for (GridRef& ref : refs) {
          const std::uint32_t position = ref.position();
          const GridBox box = frame.snap(Box4::load(&prims_[position]), position);
          box.store(&ref);
          bounds.grow(box);
        }
      });
    }
    return bounds;
  }

  // Moves the left side to the front of every order; both sides keep their order.
  void divide(const Range& range, std::size_t split_axis, std::uint32_t left_count, ThreadPool* pool) {
    const std::span<GridRef> split_rows = rows(range, split_axis);
    for_steps(split_rows.size(), cancel_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) is_left_[split_rows[i].position()] = i < left_count;
    });
    for_axes(pool, [&](std::size_t axis) {
      if (axis == split_axis) return;
      GridRef* left = rows(range, axis).data();
      GridRef* const moved = scratch_[axis == (split_axis + 1) % 3].data() + range.begin;
      GridRef* right = moved;
      for_rows(range, axis, [&](std::span<const GridRef> refs) {
        GridRef *to_left = left, *to_right = right;  // in registers
        for (const GridRef& ref : refs) {
          const bool is_left = is_left_[ref.position()] != 0;
          Short8::load(&ref).store(is_left ? to_left : to_right);
          to_left += is_left;
          to_right += !is_left;
        }
        left = to_left, right = to_right;
      });
      for_steps(static_cast<std::size_t>(right - moved), cancel_,
                [&](std::size_t begin, std::size_t end) { std::copy(moved + begin, moved + end, left + begin); });
    });
  }

  std::span<const PrimRef> prims_;
  const BuildConfig& config_;
  CancelToken& cancel_;
  std::array<AlignedVector<GridRef>, 3> sorted_;
  std::array<AlignedVector<GridRef>, 2> scratch_;  // for the two axes that are divided
  std::array<AlignedVector<float>, 3> costs_;
  std::vector<std::uint8_t> is_left_;       // by position
  AlignedVector<std::uint16_t> number_of_;  // by position, within its subtree
  Range root_;
};

}  // namespace

Bvh2 build_sweep(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  SweepSplitter splitter(prims, config, pool, cancel);
  return TopDownBuilder(splitter, pool, cancel).build(splitter.root());
}

}  // namespace perfect_bvh
