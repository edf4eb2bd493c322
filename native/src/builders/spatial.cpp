// SAH construction with spatial splits (Stich, Friedrich, Dietrich 2009, "Spatial splits in bounding volume
// hierarchies"). If the halves of an object split would overlap, space is cut instead, and references that cross the
// plane go to both sides with the boxes of their parts. Ranges too small for cutting are left to binning. It is for
// static scenery (lecture, "The top-level BVH"), because the boxes only fit these positions. In: references, settings
// (bins, costs, duplication budget), a clipper. Out: a tree that is not refittable. A primitive may be in several
// leaves, but never twice in one; each of its points is in the box of one of them.

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "builders/agglomerative.h"
#include "builders/binned_splitter.h"
#include "builders/builder.h"
#include "builders/grid.h"
#include "builders/spatial_plane.h"
#include "builders/top_down.h"
#include "core/cancel.h"

namespace perfect_bvh {
namespace {

// Space is only cut if an object split's halves overlap by this share of the root's area. The paper's alpha is 1e-5;
// the nodes between the two take most of the time and gain less than 0.5% of the cost.
constexpr float kLeastOverlap = 1e-3f;
// Space is also not cut if a range has few spare rows: a fifth of its budget, or a sixteenth of its references. Nearly
// every plane crosses more of them. With the budget used up, the search for one that does not took most of the time, to
// gain 0.1% of the cost.
constexpr float kLeastRoomOfBudget = 0.2f, kMostRoomNeeded = 1.0f / 16.0f;
constexpr std::uint32_t kSampleSize = 2048;         // references put into object bins, at least
constexpr std::uint32_t kSpatialSampleSize = 1024;  // spatial ones: using all gains 0.3%, in 1.4 to 1.6 times the time
constexpr std::uint32_t kTaskSize = 4096;           // references of a subtree that one thread makes

// Rows [begin, begin + capacity) belong to the range; the first `count` hold references. The rest is its share of the
// duplication budget, which is handed down in proportion, so that other threads' work cannot change the result.
struct SpatialRange : GridRange {
  bool is_whole = false;  // no more cuts: the rest is left to binning
  std::uint32_t capacity = 0;
  std::uint32_t work = 0;
  Box4 box;  // the union of its references'
};

// The data shared by all threads. Each thread changes only the rows of its own range.
struct Job {
  BuildConfig config;
  const PrimClipper* clipper;
  CancelToken& cancel;
  AlignedVector<PrimRef> refs;
  std::optional<BinnedSplitter> binned;  // over `refs`
  AreaScale scale;
  float least_overlap = 0.0f, least_room = 0.0f;  // areas; rows to spare for each reference
};

// Splits ranges one after another. There is one for each thread's subtree, so that its arrays are reused.
class SpatialWorker {
 public:
  explicit SpatialWorker(Job& job) : job_(job) {}

  bool split(SpatialRange& range, SpatialRange& left, SpatialRange& right) {
    const float area = range.is_whole ? 0.0f : job_.scale.half_area(range.box);
    if (!range.is_whole && range.count <= kTaskSize && !may_be_cut(range, area)) {
      range.is_whole = true;
      job_.binned->take_over(range, range.box);
    }
    if (range.is_whole) {
      left.is_whole = right.is_whole = true;
      return job_.binned->split(range, left, right);
    }
    partition_.resize(range.count);
    snap(range);
    Sides chosen;
    if (depth_allows_any_split(range)) {
      const Sides by_object = choose_object_split(range);
      chosen = area > 0.0f ? choose_spatial_split(range, area, by_object) : Sides{};
      if (!chosen.is_split()) chosen = by_object;
    }
    if (!chosen.is_split()) {
      if (range.count <= job_.config.max_leaf_size) return false;
      chosen = choose_halves(range);
    }
    share_out(range, chosen, left, right);
    partition_.move(rows(range), job_.refs.data() + right.begin, right.count, job_.cancel);
    return true;
  }

  Box4 write_leaf(const SpatialRange& range, std::uint32_t* prim_indices) const noexcept {
    if (range.is_whole) return job_.binned->write_leaf(range, prim_indices);
    for (const PrimRef& ref : rows(range)) *prim_indices++ = ref.prim_index;
    const Float4 zero(0.0f);  // -0 + 0 is +0
    return {range.box.lower + zero, range.box.upper + zero};
  }

 private:
  // Halves overlap by at most their box, and boxes only shrink: if a range may not be cut for that reason, no part of
  // it may.
  [[nodiscard]] bool may_be_cut(const SpatialRange& range, float area) const noexcept {
    return range.count > 1 && has_room(range) && area > job_.least_overlap;
  }
  [[nodiscard]] bool has_room(const SpatialRange& range) const noexcept {
    return static_cast<float>(range.capacity - range.count) > job_.least_room * static_cast<float>(range.count);
  }

  [[nodiscard]] std::span<PrimRef> rows(const SpatialRange& range) const noexcept {
    return {job_.refs.data() + range.begin, range.count};
  }

  // Object splits are chosen on a grid of the range's size (grid.h).
  void snap(const SpatialRange& range) {
    grid_.resize(range.count);
    const GridFrame frame = GridFrame::around(range.box);
    const std::span<const PrimRef> refs = rows(range);
    bounds_ = {};
    for_steps(range.count, job_.cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const GridBox box = frame.snap(Box4::load(&refs[i]), static_cast<std::uint32_t>(i));
        bounds_.grow(box);
        box.store(&grid_[i]);
      }
    });
  }

  [[nodiscard]] Sides choose_object_split(const SpatialRange& range) {
    const auto area = static_cast<float>(half_area(bounds_.box));
    if (!(area > 0.0f)) return {};
    if (range.count <= kFewBoxes) return choose_few(range, area);
    return choose_object_plane(range, area);
  }

  [[nodiscard]] Sides choose_few(const SpatialRange& range, float area) {
    std::array<GridBox, kFewBoxes> boxes;
    for (std::uint32_t i = 0; i < range.count; ++i) boxes[i] = Short8::load(&grid_[i]);
    const std::uint32_t is_left = split_few(boxes.data(), range.count, area, job_.config);
    if (is_left == 0) return {};
    return partition_.assign(rows(range), job_.cancel, [&](std::size_t i) { return ((is_left >> i) & 1u) != 0; });
  }

  [[nodiscard]] Sides choose_object_plane(const SpatialRange& range, float area) {
    const BuildConfig& config = job_.config;
    const std::uint32_t stride = std::max(1u, range.count / kSampleSize);
    const std::uint32_t count = (range.count + stride - 1) / stride;
    const std::uint32_t bin_count = std::min(config.bins, count / 2 + 4);  // few references need few planes
    const BinMap map(bounds_, bin_count);
    GridBins bins(bin_count);
    bins.add(grid_.data(), range.count, stride, map, -1);
    const Plane plane = bins.find_best(count, -1);
    if (plane.bin == 0) return {};
    if (range.count <= config.max_leaf_size) {
      const float split_cost = config.traversal_cost * area + config.intersection_cost * plane.cost;
      if (!(split_cost < config.intersection_cost * area * static_cast<float>(count))) return {};
    }
    const std::int32_t border = map.border(plane.axis, plane.bin);
    return partition_.assign(rows(range), job_.cancel, [&](std::size_t i) {
      return grid_[i].lower[plane.axis] - grid_[i].negated_upper[plane.axis] < border;
    });
  }

  // Used if the SAH decides nothing (all centroids equal, no area) or the maximum depth is near.
  [[nodiscard]] Sides choose_halves(const SpatialRange& range) {
    const std::uint32_t half = range.count / 2;
    if (bounds_.has_spread()) {
      const auto axis = static_cast<std::size_t>(bounds_.longest_axis());
      const auto key = [axis](const GridRef& ref) {
        return std::pair(ref.lower[axis] - ref.negated_upper[axis], ref.position());
      };
      select_nth(std::span(grid_), half, job_.cancel,
                 [&](const GridRef& a, const GridRef& b) { return key(a) < key(b); });
    }
    const std::span<const PrimRef> refs = rows(range);
    Sides sides;
    for_steps(range.count, job_.cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t rank = begin; rank < end; ++rank) {
        const std::uint32_t row = grid_[rank].position();
        partition_.set(row, rank < half);
        sides.add(rank < half, Box4::load(&refs[row]));
      }
    });
    return sides;
  }

  // Returns no split if an object split or a leaf is as good, or no plane is found. The object split then stays.
  [[nodiscard]] Sides choose_spatial_split(const SpatialRange& range, float area, const Sides& by_object) {
    if (!has_room(range)) return {};
    const float overlap = by_object.is_split() ? by_object.overlap(job_.scale) : area;
    if (!(overlap > job_.least_overlap)) return {};
    const auto all = static_cast<float>(range.count);
    SpatialSearch search;
    search.clipper = job_.clipper;
    search.scale = job_.scale;
    search.limit = area * all;  // a plane that costs more than no split gains nothing
    if (by_object.is_split()) search.limit = std::min(search.limit, by_object.cost(job_.scale));
    if (range.count <= job_.config.max_leaf_size) {
      const float leaf = area * all - area * (job_.config.traversal_cost / job_.config.intersection_cost);
      search.limit = std::min(search.limit, leaf);
    }
    // Slices are costly. An even number of bins has a plane in the middle, which is often the best.
    search.bin_count = std::min(std::max(job_.config.bins / 4 * 2, 2u), range.count / 8 * 2 + 4);
    search.stride = std::max(1u, range.count / kSpatialSampleSize);
    search.most_references = range.capacity;
    const SpatialPlane plane = find_spatial_plane(rows(range), range.box, search);
    if (plane.axis < 0) return {};
    return partition_.part(rows(range), plane, search, job_.cancel);
  }

  // Distributes spare rows by cost.
  void share_out(const SpatialRange& range, const Sides& sides, SpatialRange& left,
                 SpatialRange& right) const noexcept {
    const std::uint32_t all = sides.left_count + sides.right_count, spare = range.capacity - all;
    const double left_cost = static_cast<double>(job_.scale.half_area(sides.left)) * sides.left_count;
    const double cost = left_cost + static_cast<double>(job_.scale.half_area(sides.right)) * sides.right_count;
    const double share = cost > 0 && left_cost <= cost ? left_cost / cost : 0.5;
    const auto left_spare = std::min(spare, static_cast<std::uint32_t>(static_cast<double>(spare) * share));
    left.count = sides.left_count;
    right.count = sides.right_count;
    left.capacity = left.count + left_spare;
    right.capacity = right.count + (spare - left_spare);
    left.begin = range.begin;
    right.begin = range.begin + left.capacity;
    left.work = static_cast<std::uint32_t>(std::uint64_t{range.work} * left.count / all);
    right.work = range.work - left.work;
    left.depth = right.depth = range.depth + 1;
    left.box = sides.left;
    right.box = sides.right;
  }

  Job& job_;
  AlignedVector<GridRef> grid_;
  GridBounds bounds_;
  SpatialPartition partition_;
};

[[nodiscard]] BuildConfig on_all_axes(BuildConfig config) noexcept {
  config.axes = 3;
  return config;
}

class SpatialSplitter {
 public:
  using Range = SpatialRange;
  static constexpr std::uint32_t kSubtreeSize = kTaskSize;

  SpatialSplitter(std::span<const PrimRef> prims, const BuildConfig& config, const PrimClipper* clipper,
                  CancelToken& cancel)
      : job_{on_all_axes(config), clipper, cancel, {}, {}, {}} {
    // Rows, and the nodes over them, have 32-bit numbers.
    constexpr double kMostRows = std::numeric_limits<std::int32_t>::max();
    const auto count = static_cast<double>(prims.size());
    const double wanted = count + count * static_cast<double>(config.duplication_budget);
    root_.count = root_.work = static_cast<std::uint32_t>(prims.size());
    root_.capacity = static_cast<std::uint32_t>(std::min(wanted, kMostRows));
    job_.refs.resize(root_.capacity);
    job_.binned.emplace(job_.refs, job_.config, cancel);
    root_.box = Box4::empty();
    for_steps(prims.size(), cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        job_.refs[i] = prims[i];
        root_.box.grow(Box4::load(&prims[i]));
      }
    });
    job_.scale.multiplier = GridFrame::around(root_.box).multiplier;
    job_.least_overlap = kLeastOverlap * job_.scale.half_area(root_.box);
    job_.least_room = std::min(kLeastRoomOfBudget * config.duplication_budget, kMostRoomNeeded);
  }

  [[nodiscard]] const Range& root() const noexcept { return root_; }
  [[nodiscard]] SpatialWorker enter_subtree(const Range&) { return SpatialWorker(job_); }
  void split_large(Range& range, Range& left, Range& right, ThreadPool*) {
    (void)SpatialWorker(job_).split(range, left, right);
  }

 private:
  Job job_;
  Range root_;
};

// Moves the leaves' rows together, without the unused ones between them.
void close_up(Bvh2& tree, CancelToken& cancel) {
  std::size_t count = 0;
  for_steps(tree.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) count += tree.nodes[i].count;
  });
  AlignedVector<std::uint32_t> packed(count);
  std::uint32_t next = 0;
  for_steps(tree.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Bvh2Node& node = tree.nodes[i];
      if (!node.is_leaf()) continue;
      std::copy_n(tree.prim_indices.begin() + node.first, node.count, packed.begin() + next);
      node.first = next;
      next += node.count;
    }
  });
  tree.prim_indices = std::move(packed);
}

}  // namespace

Bvh2 build_spatial(std::span<const PrimRef> prims, const BuildConfig& config, const PrimClipper* clipper,
                   ThreadPool& pool, CancelToken& cancel) {
  SpatialSplitter splitter(prims, config, clipper, cancel);
  Bvh2 tree = TopDownBuilder(splitter, pool, cancel).build(splitter.root());
  close_up(tree, cancel);
  tree.refittable = false;
  return tree;
}

}  // namespace perfect_bvh
