#include "build/binned.h"

#include <algorithm>
#include <array>
#include <limits>

#include "build/top_down.h"
#include "build/working_refs.h"

namespace perfect_bvh {
namespace {

constexpr std::uint32_t kMaxBins = 256;
constexpr std::uint32_t kParallelSize = 65536;  // references from which on one node's work is shared out
constexpr std::uint32_t kMinChunk = 16384;      // and what a thread then takes at a time

// Maps doubled centroids to bins. The same arithmetic bins and partitions, so that both always agree.
class BinMap {
 public:
  BinMap(const Box4& centroids, std::uint32_t bin_count) noexcept : last_(static_cast<float>(bin_count - 1)) {
    alignas(16) std::array<float, 4> scale, lower;
    centroids.extent().store(scale.data());
    centroids.lower.store(lower.data());
    for (float& s : scale)
      s = std::min(static_cast<float>(bin_count) / s, std::numeric_limits<float>::max());
    // The fourth lane holds bits of a primitive's number; as a float it may be denormal, and slow to multiply.
    scale[3] = 0.0f;
    lower[3] = -1.0f;
    scale_ = Float4::load(scale.data());
    lower_ = Float4::load(lower.data());
  }

  // Bins of the three axes. The comparisons turn NaN (overflown centroids) into 0.
  [[nodiscard]] Int4 operator()(Float4 centroid) const noexcept {
    const Float4 place = (centroid - lower_) * scale_;
    return truncate(min(max(place, Float4(0.0f)), last_));
  }

 private:
  Float4 lower_, scale_, last_;
};

// Boxes and counts of what fell into each bin of each axis.
struct Bins {
  std::uint32_t size;  // bins an axis; the rows of axis a start at a * size
  std::array<Box4, 3 * kMaxBins> boxes;
  std::array<std::uint32_t, 3 * kMaxBins> counts;

  void clear(std::uint32_t bin_count) noexcept {
    size = bin_count;
    std::fill_n(boxes.begin(), 3 * size, Box4::empty());
    std::fill_n(counts.begin(), 3 * size, 0u);
  }
  void add(std::uint32_t row, const Box4& box) noexcept {
    boxes[row].grow(box);
    ++counts[row];
  }
  void add(const PrimRef* refs, std::size_t count, const BinMap& map) noexcept {
    for (std::size_t i = 0; i < count; ++i) {
      const Box4 box = Box4::load(&refs[i]);
      const Int4 bin = map(doubled_centroid(box));
      add(bin.small<0>(), box);
      add(size + bin.small<1>(), box);
      add(2 * size + bin.small<2>(), box);
    }
  }
  void add(const Bins& other) noexcept {
    for (std::uint32_t row = 0; row < 3 * size; ++row) {
      boxes[row].grow(other.boxes[row]);
      counts[row] += other.counts[row];
    }
  }
};

struct Split {
  float cost = std::numeric_limits<float>::infinity();  // area * count of the left side plus that of the right
  std::uint32_t axis = 0;
  std::uint32_t bin = 0;  // the first of the right side; 0: no split
  std::uint32_t left_count = 0;
};

// One sweep from the right for the areas there, one from the left to price each plane.
void find_best_plane(const Bins& bins, std::uint32_t axis, Float4 scale, Split& best) noexcept {
  std::array<float, kMaxBins> right_costs;
  const Box4* boxes = &bins.boxes[axis * bins.size];
  const std::uint32_t* counts = &bins.counts[axis * bins.size];
  Box4 box = Box4::empty();
  std::uint32_t right_count = 0;
  for (std::uint32_t i = bins.size - 1; i > 0; --i) {
    box.grow(boxes[i]);
    right_count += counts[i];
    right_costs[i] =
        right_count == 0 ? 0.0f : half_area(box.extent() * scale) * static_cast<float>(right_count);
  }
  const std::uint32_t count = right_count + counts[0];
  box = Box4::empty();
  std::uint32_t left_count = 0;
  for (std::uint32_t i = 1; i < bins.size; ++i) {
    box.grow(boxes[i - 1]);
    left_count += counts[i - 1];
    if (left_count == 0 || left_count == count)
      continue;
    const float cost = half_area(box.extent() * scale) * static_cast<float>(left_count) + right_costs[i];
    if (cost < best.cost)
      best = {cost, axis, i, left_count};
  }
}

// Copies the rows of the left side to the front of `to` and those of the right side to its end, last row first.
template <int Axis>
void partition(const PrimRef* from, std::size_t count, const BinMap& map, std::uint32_t split_bin, PrimRef* left,
               PrimRef* right, Box4& left_centroids, Box4& right_centroids) noexcept {
  std::array<Box4, 2> centroids{right_centroids, left_centroids};
  for (std::size_t i = 0; i < count; ++i) {
    const Box4 box = Box4::load(&from[i]);
    const Float4 centroid = doubled_centroid(box);
    const bool is_left = map(centroid).small<Axis>() < split_bin;
    PrimRef* to = is_left ? left : right;
    box.lower.store(&to->lower);
    box.upper.store(&to->upper);
    centroids[is_left].grow(centroid);
    left += is_left;
    right -= !is_left;
  }
  right_centroids = centroids[0];
  left_centroids = centroids[1];
}

using Partition = decltype(&partition<0>);
constexpr std::array<Partition, 3> kPartitions{&partition<0>, &partition<1>, &partition<2>};

class BinnedSplitter {
 public:
  BinnedSplitter(WorkingRefs& refs, const BuildConfig& config)
      : refs_(refs), config_(config), scale_(area_scale(refs.root.box)) {}

  bool split(const BuildRange& range, BuildRange& left, BuildRange& right, ThreadPool* pool) const {
    if (range.count == 1)
      return false;
    const float area = half_area(range.box.extent() * scale_);
    if (area > 0.0f && depth_allows_any_split(range)) {
      const bool parallel = pool != nullptr && range.count >= kParallelSize;
      const BinMap map(range.centroids, bin_count(range.count));
      if (parallel ? split_together(range, area, map, left, right, *pool)
                   : split_alone(range, area, map, left, right)) {
        return true;
      }
    }
    if (range.count <= config_.max_leaf_size)
      return false;
    split_in_halves(range, rows(range, range.in_scratch), left, right);
    return true;
  }

  void write_leaf(const BuildRange& range, std::uint32_t* prim_indices) const {
    const PrimRef* from = refs_.rows(range);
    for (std::uint32_t i = 0; i < range.count; ++i)
      prim_indices[i] = from[i].prim_index;
  }

 private:
  [[nodiscard]] PrimRef* rows(const BuildRange& range, bool in_scratch) const noexcept {
    return (in_scratch ? refs_.scratch : refs_.refs).data() + range.begin;
  }

  // Few references need few planes.
  [[nodiscard]] std::uint32_t bin_count(std::uint32_t ref_count) const noexcept {
    return std::min(config_.bins, ref_count / 2 + 4);
  }

  bool split_alone(const BuildRange& range, float area, const BinMap& map, BuildRange& left, BuildRange& right) const {
    Bins bins;
    bins.clear(bin_count(range.count));
    bins.add(refs_.rows(range), range.count, map);
    const Split best = find_best(range, area, bins);
    if (best.bin == 0)
      return false;
    make_children(range, bins, best, left, right);
    PrimRef* to = rows(range, !range.in_scratch);
    kPartitions[best.axis](refs_.rows(range), range.count, map, best.bin, to, to + range.count - 1, left.centroids,
                           right.centroids);
    return true;
  }

  // The chunks' own counts say where each one's share goes, so that it lands where a single thread would put it.
  bool split_together(const BuildRange& range, float area, const BinMap& map, BuildRange& left, BuildRange& right,
                      ThreadPool& pool) const {
    const PrimRef* from = refs_.rows(range);
    const std::uint32_t chunk_size = std::max(kMinChunk, range.count / 32);
    AlignedVector<Bins> chunks((range.count + chunk_size - 1) / chunk_size);
    parallel_for(pool, range.count, chunk_size, [&](std::size_t begin, std::size_t end) {
      Bins& bins = chunks[begin / chunk_size];
      bins.clear(bin_count(range.count));
      bins.add(from + begin, end - begin, map);
    });
    Bins bins = chunks.front();
    for (std::size_t i = 1; i < chunks.size(); ++i)
      bins.add(chunks[i]);
    const Split best = find_best(range, area, bins);
    if (best.bin == 0)
      return false;
    make_children(range, bins, best, left, right);

    struct Share {
      std::size_t left_before = 0;
      Box4 left = Box4::empty(), right = Box4::empty();
    };
    AlignedVector<Share> shares(chunks.size());
    std::size_t left_before = 0;
    for (std::size_t i = 0; i < chunks.size(); ++i) {
      shares[i] = {left_before, Box4::empty(), Box4::empty()};
      const std::uint32_t* counts = &chunks[i].counts[best.axis * bins.size];
      for (std::uint32_t bin = 0; bin < best.bin; ++bin)
        left_before += counts[bin];
    }
    PrimRef* to = rows(range, !range.in_scratch);
    parallel_for(pool, range.count, chunk_size, [&](std::size_t begin, std::size_t end) {
      Share& share = shares[begin / chunk_size];
      kPartitions[best.axis](from + begin, end - begin, map, best.bin, to + share.left_before,
                             to + range.count - 1 - (begin - share.left_before), share.left, share.right);
    });
    for (const Share& share : shares)
      left.centroids.grow(share.left), right.centroids.grow(share.right);
    return true;
  }

  // The cheapest plane, if it costs less than the leaf or there is no leaf to be had.
  [[nodiscard]] Split find_best(const BuildRange& range, float area, const Bins& bins) const noexcept {
    Split best;
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      if (config_.axes == 3 || axis == longest_axis(range))
        find_best_plane(bins, axis, scale_, best);
    }
    const float leaf_cost = config_.intersection_cost * area * static_cast<float>(range.count);
    const float split_cost = config_.traversal_cost * area + config_.intersection_cost * best.cost;
    if (range.count <= config_.max_leaf_size && !(split_cost < leaf_cost))
      best.bin = 0;
    return best;
  }

  [[nodiscard]] static std::uint32_t longest_axis(const BuildRange& range) noexcept {
    alignas(16) std::array<float, 4> spread;
    range.centroids.extent().store(spread.data());
    return static_cast<std::uint32_t>(std::max_element(spread.begin(), spread.begin() + 3) - spread.begin());
  }

  static void make_children(const BuildRange& range, const Bins& bins, const Split& best, BuildRange& left,
                            BuildRange& right) noexcept {
    left = {Box4::empty(), Box4::empty(), range.begin, best.left_count, range.depth + 1, !range.in_scratch};
    right = {Box4::empty(),   Box4::empty(),    range.begin + best.left_count, range.count - best.left_count,
             range.depth + 1, !range.in_scratch};
    const Box4* boxes = &bins.boxes[best.axis * bins.size];
    for (std::uint32_t i = 0; i < bins.size; ++i)
      (i < best.bin ? left : right).box.grow(boxes[i]);
  }

  WorkingRefs& refs_;
  const BuildConfig& config_;
  const Float4 scale_;
};

}  // namespace

Bvh2 build_binned(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  WorkingRefs refs(prims, pool);
  const BinnedSplitter splitter(refs, config);
  return TopDownBuilder(splitter, pool, cancel).build(refs.root);
}

}  // namespace perfect_bvh
