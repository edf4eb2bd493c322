#include "build/spatial.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "build/few_boxes.h"
#include "build/grid_bins.h"
#include "build/grid_ref.h"
#include "build/spatial_plane.h"
#include "build/top_down.h"

namespace perfect_bvh {
namespace {

// Space is only cut where an object split's halves overlap by this share of the root's area. The paper's alpha is 1e-5;
// the nodes between the two take most of the time and gain less than 0.5% of the cost.
constexpr float kLeastOverlap = 1e-3f;
constexpr std::uint32_t kSampleSize = 2048;  // references put into object bins, at least

// Rows [begin, begin + capacity) belong to the range, the first `count` hold references. The rest is its share of the
// duplication budget: handed down in proportion, so that no other thread's work can change what it may do.
struct SpatialRange : BuildRange {
  std::uint32_t capacity = 0;
  std::uint32_t work = 0;
  Box4 box;  // the union of its references'
};

// Where the rows of a range go.
struct Sides {
  Box4 left = Box4::empty(), right = Box4::empty();
  std::uint32_t left_count = 0, right_count = 0;

  void add(bool is_left, const Box4& box) noexcept {
    (is_left ? left : right).grow(box);
    ++(is_left ? left_count : right_count);
  }
  [[nodiscard]] bool is_split() const noexcept { return left_count > 0 && right_count > 0; }
  [[nodiscard]] float cost(const AreaScale& scale) const noexcept {
    return scale.half_area(left) * static_cast<float>(left_count) +
           scale.half_area(right) * static_cast<float>(right_count);
  }
};

struct Parts {
  Box4 left, right;
};

// What is shared by all threads; each of them changes only the rows of its own range.
struct Job {
  const BuildConfig& config;
  const PrimClipper* clipper;
  AlignedVector<PrimRef> refs;
  AreaScale scale;
  float least_overlap = 0.0f;
};

[[nodiscard]] float overlap_of(const Sides& sides, const AreaScale& scale) noexcept {
  const Box4 common{max(sides.left.lower, sides.right.lower), min(sides.left.upper, sides.right.upper)};
  return is_empty(common) ? 0.0f : scale.half_area(common);
}

void set_box(PrimRef& ref, const Box4& box) noexcept {
  alignas(16) std::array<float, 4> lower, upper;
  box.lower.store(lower.data());
  box.upper.store(upper.data());
  ref.lower = {lower[0], lower[1], lower[2]};
  ref.upper = {upper[0], upper[1], upper[2]};
}

// Splits ranges one after another; one for each thread's subtree, so that its arrays are reused.
class SpatialWorker {
 public:
  explicit SpatialWorker(Job& job) : job_(job) {}

  bool split(SpatialRange& range, SpatialRange& left, SpatialRange& right) {
    if (range.count == 1) return false;
    sides_.resize(range.count);
    snap(range);
    const float area = job_.scale.half_area(range.box);
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
    move(range, right);
    return true;
  }

  Box4 write_leaf(const SpatialRange& range, std::uint32_t* prim_indices) const noexcept {
    const PrimRef* const refs = rows(range);
    for (std::uint32_t i = 0; i < range.count; ++i) prim_indices[i] = refs[i].prim_index;
    const Float4 zero(0.0f);  // -0 + 0 is +0
    return {range.box.lower + zero, range.box.upper + zero};
  }

 private:
  [[nodiscard]] PrimRef* rows(const SpatialRange& range) const noexcept { return job_.refs.data() + range.begin; }
  [[nodiscard]] Box4 box_of(const SpatialRange& range, std::uint32_t row) const noexcept {
    return Box4::load(rows(range) + row);
  }

  // Object splits are chosen on a grid of the range's own size (grid_ref.h).
  void snap(const SpatialRange& range) {
    grid_.resize(range.count);
    const GridFrame frame = GridFrame::around(range.box);
    bounds_ = {};
    for (std::uint32_t i = 0; i < range.count; ++i) {
      const GridBox box = frame.snap(box_of(range, i), i);
      bounds_.grow(box);
      box.store(&grid_[i]);
    }
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
    return assign(range, [&](std::uint32_t i) { return ((is_left >> i) & 1u) != 0; });
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
    return assign(range, [&](std::uint32_t i) {
      return grid_[i].lower[plane.axis] - grid_[i].negated_upper[plane.axis] < border;
    });
  }

  // Where the SAH says nothing (all centroids equal, no area) or the depth runs out.
  [[nodiscard]] Sides choose_halves(const SpatialRange& range) {
    const std::uint32_t half = range.count / 2;
    if (bounds_.has_spread()) {
      const auto axis = static_cast<std::size_t>(bounds_.longest_axis());
      const auto key = [axis](const GridRef& ref) {
        return std::pair(ref.lower[axis] - ref.negated_upper[axis], ref.position());
      };
      std::nth_element(grid_.begin(), grid_.begin() + half, grid_.end(),
                       [&](const GridRef& a, const GridRef& b) { return key(a) < key(b); });
    }
    Sides sides;
    for (std::uint32_t rank = 0; rank < range.count; ++rank) {
      const std::uint32_t row = grid_[rank].position();
      sides_[row] = rank < half ? PlaneSide::kLeft : PlaneSide::kRight;
      sides.add(rank < half, box_of(range, row));
    }
    return sides;
  }

  template <class IsLeft>
  [[nodiscard]] Sides assign(const SpatialRange& range, const IsLeft& is_left) noexcept {
    Sides sides;
    for (std::uint32_t i = 0; i < range.count; ++i) {
      const bool left = is_left(i);
      sides_[i] = left ? PlaneSide::kLeft : PlaneSide::kRight;
      sides.add(left, box_of(range, i));
    }
    return sides;
  }

  // Not split: an object split or a leaf is as good, or no plane is to be had. Then sides_ is as it was.
  [[nodiscard]] Sides choose_spatial_split(const SpatialRange& range, float area, const Sides& by_object) {
    if (range.capacity == range.count) return {};
    const auto all = static_cast<float>(range.count);
    float limit = area * all;  // no gain in a plane that costs more than none
    if (by_object.is_split()) {
      if (!(overlap_of(by_object, job_.scale) > job_.least_overlap)) return {};
      limit = std::min(limit, by_object.cost(job_.scale));
    }
    if (range.count <= job_.config.max_leaf_size) {
      limit = std::min(limit, area * all - area * (job_.config.traversal_cost / job_.config.intersection_cost));
    }
    // Slices are dear. An even number of bins has a plane in the middle, which is often the best.
    const std::uint32_t bin_count = std::min(std::max(job_.config.bins / 4 * 2, 2u), range.count / 8 * 2 + 4);
    const SpatialPlane plane = find_spatial_plane({rows(range), range.count}, range.box, bin_count, job_.clipper,
                                                  job_.scale, limit, range.capacity);
    return plane.axis < 0 ? Sides{} : divide(range, plane);
  }

  // Decides for each reference on the plane whether its parts part or it goes to one side as a whole ("reference
  // unsplitting", section 4.4).
  [[nodiscard]] Sides divide(const SpatialRange& range, const SpatialPlane& plane) {
    SpatialPlane now = plane;
    Sides sides;
    parts_.clear();
    planned_.resize(range.count);
    for (std::uint32_t i = 0; i < range.count; ++i) {
      const PrimRef& ref = rows(range)[i];
      const Box4 box = Box4::load(&ref);
      PlaneSide side = side_of(ref, plane.axis, plane.place);
      if (side == PlaneSide::kBoth) {
        std::array<Box4, 2> slices;
        slice_reference(ref, plane.axis, {&plane.place, 1}, job_.clipper, slices.data());
        side = unsplit(now, box, slices);
        if (side == PlaneSide::kBoth) {
          parts_.push_back({slices[0], slices[1]});
          sides.add(true, slices[0]);
          sides.add(false, slices[1]);
          planned_[i] = side;
          continue;
        }
      }
      sides.add(side == PlaneSide::kLeft, box);
      planned_[i] = side;
    }
    if (!sides.is_split() || sides.left_count + sides.right_count > range.capacity) return {};
    std::swap(sides_, planned_);
    return sides;
  }

  [[nodiscard]] PlaneSide unsplit(SpatialPlane& now, const Box4& box, std::array<Box4, 2>& slices) const noexcept {
    if (is_empty(slices[0]) || is_empty(slices[1])) {  // its box crosses the plane, itself it does not
      const bool left = is_empty(slices[1]);
      --(left ? now.right_count : now.left_count);
      (left ? now.left : now.right).grow(box);
      return left ? PlaneSide::kLeft : PlaneSide::kRight;
    }
    const AreaScale& scale = job_.scale;
    const auto left_count = static_cast<float>(now.left_count), right_count = static_cast<float>(now.right_count);
    const float left_area = scale.half_area(now.left), right_area = scale.half_area(now.right);
    Box4 wide_left = now.left, wide_right = now.right;
    wide_left.grow(box);
    wide_right.grow(box);
    const float parted = left_area * left_count + right_area * right_count;
    const float all_left = scale.half_area(wide_left) * left_count + right_area * (right_count - 1.0f);
    const float all_right = left_area * (left_count - 1.0f) + scale.half_area(wide_right) * right_count;
    if (now.right_count > 1 && all_left < parted && all_left <= all_right) {
      now.left = wide_left;
      --now.right_count;
      return PlaneSide::kLeft;
    }
    if (now.left_count > 1 && all_right < parted) {
      now.right = wide_right;
      --now.left_count;
      return PlaneSide::kRight;
    }
    return PlaneSide::kBoth;
  }

  // Spare rows go where the cost is.
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

  void move(const SpatialRange& range, const SpatialRange& right) {
    PrimRef* const refs = rows(range);
    moved_.resize(right.count);
    PrimRef *to_left = refs, *to_right = moved_.data();
    const Parts* parts = parts_.data();
    for (std::uint32_t i = 0; i < range.count; ++i) {
      PrimRef ref = refs[i];
      if (sides_[i] == PlaneSide::kLeft) {
        *to_left++ = ref;
      } else if (sides_[i] == PlaneSide::kRight) {
        *to_right++ = ref;
      } else {
        set_box(ref, parts->left);
        *to_left++ = ref;
        set_box(ref, parts->right);
        *to_right++ = ref;
        ++parts;
      }
    }
    std::copy(moved_.begin(), moved_.end(), rows(right));
  }

  Job& job_;
  AlignedVector<GridRef> grid_;
  GridBounds bounds_;
  std::vector<PlaneSide> sides_, planned_;  // of each row; kBoth: the next of parts_
  std::vector<Parts> parts_;
  AlignedVector<PrimRef> moved_;
};

class SpatialSplitter {
 public:
  using Range = SpatialRange;
  static constexpr std::uint32_t kSubtreeSize = 4096;

  SpatialSplitter(std::span<const PrimRef> prims, const BuildConfig& config, const PrimClipper* clipper)
      : job_{config, clipper, {}, {}} {
    // Rows have 32-bit numbers, and so have the nodes over them.
    constexpr double kMostRows = std::numeric_limits<std::int32_t>::max();
    const auto count = static_cast<double>(prims.size());
    const double wanted = count + count * static_cast<double>(config.duplication_budget);
    root_.count = root_.work = static_cast<std::uint32_t>(prims.size());
    root_.capacity = static_cast<std::uint32_t>(std::min(wanted, kMostRows));
    job_.refs.resize(root_.capacity);
    std::copy(prims.begin(), prims.end(), job_.refs.begin());
    root_.box = Box4::empty();
    for (const PrimRef& prim : prims) root_.box.grow(Box4::load(&prim));
    job_.scale.multiplier = GridFrame::around(root_.box).multiplier;
    job_.least_overlap = kLeastOverlap * job_.scale.half_area(root_.box);
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

// Leaves' rows without the unused ones between them.
void close_up(Bvh2& tree) {
  std::size_t count = 0;
  for (const Bvh2Node& node : tree.nodes) count += node.count;
  AlignedVector<std::uint32_t> packed(count);
  std::uint32_t next = 0;
  for (Bvh2Node& node : tree.nodes) {
    if (!node.is_leaf()) continue;
    std::copy_n(tree.prim_indices.begin() + node.first, node.count, packed.begin() + next);
    node.first = next;
    next += node.count;
  }
  tree.prim_indices = std::move(packed);
}

}  // namespace

Bvh2 build_spatial(std::span<const PrimRef> prims, const BuildConfig& config, const PrimClipper* clipper,
                   ThreadPool& pool, CancelToken& cancel) {
  SpatialSplitter splitter(prims, config, clipper);
  Bvh2 tree = TopDownBuilder(splitter, pool, cancel).build(splitter.root());
  close_up(tree);
  tree.refittable = false;
  return tree;
}

}  // namespace perfect_bvh
