#include "builders/locally_ordered.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <vector>

#include "builders/morton.h"
#include "core/cancel.h"
#include "core/errors.h"

namespace perfect_bvh {
namespace {

// How far along the curve a partner is searched. More than 3 lowers the cost of the tree by at most 1%.
constexpr int kRadius = 3;
// The lowest bits of a distance hold the exclusive or of the two positions. So equal distances form pairs along the
// whole curve, and a position's partner is known from its best distance. 2 * kRadius < kTags.
constexpr int kTags = 16;
constexpr std::size_t kPadding = 16;  // entries before and after the row, too far away to be chosen
constexpr float kFarAway = 1e15f;
constexpr std::size_t kRegion = 1024;  // boxes that one thread joins alone ...
constexpr std::uint32_t kGroup = 32;   // ... to groups of at most this many
// If fewer than one in this many is joined with its chosen partner, all are joined two by two along the curve.
// Otherwise, nested boxes would be joined one at a time.
constexpr std::size_t kLeastProgress = 8;
// After this many rounds, all are joined two by two, so that no tree is deeper than kMaxTreeDepth. A group has at most
// 31 levels, and these rounds one each; of 2^26 groups they leave 2^18 at most. Ten million groups take fewer rounds.
constexpr int kMostRounds = 44;

// The clusters without a parent yet, by position along the curve.
class Row {
 public:
  explicit Row(std::size_t capacity)
      : stride_((capacity + 2 * kPadding + 15) / 16 * 16), storage_((6 + kRadius) * stride_) {
    numbers_.resize(capacity);
    partners_.resize(capacity + 4);
  }

  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  [[nodiscard]] std::uint32_t number(std::size_t place) const noexcept { return numbers_[place]; }

  void push_back(const Cluster& cluster, std::uint32_t number) noexcept {
    put(count_, cluster);
    numbers_[count_++] = number;
  }

  // Joins pairs into new clusters numbered from `next` on; returns the next free number.
  std::uint32_t join_pairs(Cluster* clusters, std::uint32_t next, CancelToken& cancel) {
    set_padding();
    ++round_;
    measure_distances(cancel);
    choose_partners(cancel);
    std::size_t pairs = 0;
    for_steps(count_, cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) pairs += partners_[i] > i && partners_[partners_[i]] == i;
    });
    if (pairs * kLeastProgress < count_ || round_ > kMostRounds) choose_neighbours(cancel);
    std::size_t kept = 0;
    for_steps(count_, cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) next = keep_or_join(i, clusters, next, kept);
    });
    count_ = kept;
    return next;
  }

 private:
  [[nodiscard]] float* plane(int number) noexcept {
    return &storage_[static_cast<std::size_t>(number) * stride_ + kPadding];
  }
  // distance(k)[i] is the distance between the clusters at positions i and i + k.
  [[nodiscard]] float* distance(int k) noexcept { return plane(5 + k); }

  void put(std::size_t place, const Cluster& cluster) noexcept {
    plane(0)[place] = cluster.lower.x, plane(1)[place] = cluster.lower.y, plane(2)[place] = cluster.lower.z;
    plane(3)[place] = cluster.upper.x, plane(4)[place] = cluster.upper.y, plane(5)[place] = cluster.upper.z;
  }
  [[nodiscard]] Cluster get(std::size_t place) noexcept {
    return {
        {plane(0)[place], plane(1)[place], plane(2)[place]}, 0, {plane(3)[place], plane(4)[place], plane(5)[place]}, 0};
  }
  [[nodiscard]] static Cluster joined(const Cluster& a, const Cluster& b, std::uint32_t left,
                                      std::uint32_t right) noexcept {
    return {min(a.lower, b.lower), left, max(a.upper, b.upper), right};
  }

  void set_padding() noexcept {
    for (int axis = 0; axis < 6; ++axis) {
      const float far = axis < 3 ? -kFarAway : kFarAway;  // its joint box with any other is huge
      std::fill_n(plane(axis) - kPadding, kPadding, far);
      std::fill_n(plane(axis) + count_, kPadding, far);
    }
  }

  [[nodiscard]] static Int4 places_from(std::ptrdiff_t i) noexcept {
    return Int4(static_cast<std::int32_t>(i)) + Int4(0, 1, 2, 3);
  }

  // Compacts entry i to the front: the cluster, or its union with its partner.
  std::uint32_t keep_or_join(std::size_t i, Cluster* clusters, std::uint32_t next, std::size_t& kept) noexcept {
    const std::size_t partner = partners_[i];
    const bool is_pair = partner != i && partners_[partner] == i;
    if (is_pair && partner < i) return next;
    Cluster cluster = get(i);
    std::uint32_t number = numbers_[i];
    if (is_pair) {
      cluster = joined(cluster, get(partner), number, numbers_[partner]);
      number = next++;
      clusters[number] = cluster;
    }
    put(kept, cluster);  // a pair's second half comes later, and is then only read for its partner
    numbers_[kept++] = number;
    return next;
  }

  void choose_neighbours(CancelToken& cancel) {
    for_steps(count_, cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) partners_[i] = static_cast<std::uint32_t>(std::min(i ^ 1, count_ - 1));
    });
  }

  // Four positions at a time, starting four before the first.
  void measure_distances(CancelToken& cancel) {
    for_steps(count_ + 4, cancel, [&](std::size_t begin, std::size_t end) {
      measure_distances(static_cast<std::ptrdiff_t>(begin) - 4, static_cast<std::ptrdiff_t>(end) - 4);
    });
  }
  void measure_distances(std::ptrdiff_t begin, std::ptrdiff_t end) noexcept {
    for (std::ptrdiff_t i = begin; i < end; i += 4) {
      std::array<Float4, 3> lower, upper;
      for (int axis = 0; axis < 3; ++axis) {
        lower[static_cast<std::size_t>(axis)] = Float4::load(plane(axis) + i);
        upper[static_cast<std::size_t>(axis)] = Float4::load(plane(axis + 3) + i);
      }
      const auto side = [&](int axis, int k) {
        const auto a = static_cast<std::size_t>(axis);
        return max(upper[a], Float4::load_unaligned(plane(axis + 3) + i + k)) -
               min(lower[a], Float4::load_unaligned(plane(axis) + i + k));
      };
      for (int k = 1; k <= kRadius; ++k) {
        const Float4 x = side(0, k), y = side(1, k), z = side(2, k);
        const Int4 tag = (places_from(i) ^ places_from(i + k)) & Int4(kTags - 1);
        tagged(x * y + (x + y) * z, Int4(kTags - 1), tag).store(distance(k) + i);
      }
    }
  }

  void choose_partners(CancelToken& cancel) {
    for_steps(count_, cancel, [&](std::size_t begin, std::size_t end) { choose_partners(begin, end); });
  }
  void choose_partners(std::size_t begin, std::size_t end) noexcept {
    for (std::size_t i = begin; i < end; i += 4) {
      Float4 best = Float4::load(distance(1) + i);
      for (int k = 1; k <= kRadius; ++k) {
        best = min(min(Float4::load(distance(k) + i), Float4::load_unaligned(distance(k) + i - k)), best);
      }
      // The lowest bits of the partner's position are known, and it is less than kTags / 2 away.
      const Int4 own = places_from(static_cast<std::ptrdiff_t>(i)), half(kTags / 2);
      const Int4 ahead = ((bits_of(best) ^ own) - own) & Int4(kTags - 1);
      (own + ((ahead ^ half) - half)).store(&partners_[i]);
    }
  }

  std::size_t stride_;
  AlignedVector<float> storage_;  // six planes, then kRadius distances
  AlignedVector<std::uint32_t> numbers_, partners_;
  std::size_t count_ = 0;
  int round_ = 0;
};

// Processes a region's boxes one after another, and joins complete subtrees between two borders.
class RadixStack {
 public:
  RadixStack(ClusterTree& tree, std::uint32_t begin, std::uint32_t end)
      : tree_(tree), first_(begin), next_(tree.box_count + begin), group_from_(end - begin, kNone) {
    for (std::uint32_t i = begin; i < end; ++i) {
      const std::uint64_t border = i == begin ? kBorderOfRegion : border_before(i);
      join_below(border);
      stack_[depth_++] = {i, i, 1, border};
    }
    join_below(kBorderOfRegion);
    close(stack_[0]);
  }

  [[nodiscard]] std::uint32_t next() const noexcept { return next_; }
  // Lists the remaining clusters, in the order of the curve.
  void list_groups(std::vector<std::uint32_t>& groups) const {
    std::copy_if(group_from_.begin(), group_from_.end(), std::back_inserter(groups),
                 [](std::uint32_t cluster) { return cluster != kNone; });
  }

 private:
  static constexpr std::uint64_t kBorderOfRegion = ~std::uint64_t{0};
  static constexpr std::uint32_t kNone = ~0u;
  // Borders on the stack differ in their highest bits, of which there are at most 40 here. If a box covers several
  // codes, as runs of triangles do, the borders inside one run's subtree may not differ, but there are at most 16 of
  // them.
  static constexpr std::size_t kMostDepth = 64;

  struct Entry {
    std::uint32_t cluster, first_box;
    std::uint32_t box_count;  // 0: its clusters are groups already
    std::uint64_t border;     // before it
  };

  // Equal codes are distinguished by their positions: repeated halving, as with codes.
  [[nodiscard]] std::uint64_t border_before(std::uint32_t box) const noexcept {
    return std::uint64_t{tree_.clusters[box - 1].right ^ tree_.clusters[box].left} << 32 | ((box - 1) ^ box);
  }

  void join_below(std::uint64_t border) noexcept {
    while (depth_ >= 2 && stack_[depth_ - 1].border < border) {
      Entry& left = stack_[depth_ - 2];
      const Entry& right = stack_[depth_ - 1];
      if (left.box_count != 0 && right.box_count != 0 && left.box_count + right.box_count <= kGroup) {
        Box4 box = tree_.clusters[left.cluster].box();
        box.grow(tree_.clusters[right.cluster].box());
        tree_.clusters[next_] = make_cluster(box, left.cluster, right.cluster);
        left.cluster = next_++;
        left.box_count += right.box_count;
      } else {
        close(left);
        close(right);
        left.box_count = 0;
      }
      --depth_;
    }
  }

  void close(const Entry& entry) noexcept {
    if (entry.box_count != 0) group_from_[entry.first_box - first_] = entry.cluster;
  }

  ClusterTree& tree_;
  std::uint32_t first_, next_;
  std::vector<std::uint32_t> group_from_;  // by first box
  std::array<Entry, kMostDepth> stack_;
  std::size_t depth_ = 0;
};

}  // namespace

BoxesAlongCurve make_room_for_clusters(std::size_t box_count, Scratch& scratch) {
  if (box_count > std::numeric_limits<std::uint32_t>::max() / 3) throw EngineError("too many boxes to be clustered");
  // At most as many pairs in the regions, and as many again of their groups, but usually far fewer. Unused memory is
  // never touched.
  scratch.expect(3 * box_count * sizeof(Cluster) + box_count * sizeof(Cluster) / 4);
  return {scratch.take<Cluster>(3 * box_count), static_cast<std::uint32_t>(box_count)};
}

ClusterTree cluster_along_curve(const BoxesAlongCurve& boxes, ThreadPool& pool, CancelToken& cancel) {
  ClusterTree tree;
  const std::uint32_t count = boxes.count;
  tree.clusters = boxes.clusters;
  tree.box_count = count;
  tree.regions.resize((count + kRegion - 1) / kRegion);
  std::vector<std::vector<std::uint32_t>> groups(tree.regions.size());
  for_chunks(pool, count, kRegion, cancel, [&](std::size_t begin, std::size_t end) {
    const RadixStack stack(tree, static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end));
    tree.regions[begin / kRegion] = {static_cast<std::uint32_t>(count + begin), stack.next()};
    stack.list_groups(groups[begin / kRegion]);
  });
  std::size_t group_count = 0;
  for (const auto& numbers : groups) group_count += numbers.size();
  Row row(group_count);
  for_steps(groups.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      for (const std::uint32_t number : groups[i]) row.push_back(tree.clusters[number], number);
    }
  });
  tree.top = {2 * count, 2 * count};
  while (row.size() > 1) {
    cancel.checkpoint();
    tree.top.end = row.join_pairs(tree.clusters.data(), tree.top.end, cancel);
  }
  tree.root = row.number(0);
  return tree;
}

// Curve ---------------------------------------------------------------------------------------------------------------

namespace {

struct Bounds {
  Box4 boxes = Box4::empty(), centers = Box4::empty();
};

[[nodiscard]] Bounds measure_bounds(std::span<const PrimRef> prims, ThreadPool& pool, CancelToken& cancel) {
  AlignedVector<Bounds> chunks(chunk_count_of(prims.size()));
  for_chunks(pool, prims.size(), kItemsBetweenAsking, cancel, [&](std::size_t begin, std::size_t end) {
    Bounds bounds;
    for (std::size_t i = begin; i < end; ++i) {
      const Box4 box = Box4::load(&prims[i]);
      bounds.boxes.grow(box);
      bounds.centers.grow(MortonGrid::center(box));
    }
    chunks[begin / kItemsBetweenAsking] = bounds;
  });
  Bounds all;
  for (const Bounds& chunk : chunks) all.boxes.grow(chunk.boxes), all.centers.grow(chunk.centers);
  return all;
}

}  // namespace

Curve::Curve(std::span<const PrimRef> prims, float (*scale_of)(const Box4& bounds), ThreadPool& pool,
             CancelToken& cancel)
    : prims_(prims) {
  scratch_.expect(2 * prims.size() * sizeof(std::uint64_t));
  const auto keys = scratch_.take<std::uint64_t>(prims.size()), second = scratch_.take<std::uint64_t>(prims.size());
  const Bounds bounds = measure_bounds(prims, pool, cancel);
  bounds_ = bounds.boxes;
  const MortonGrid grid(bounds.centers);
  for_chunks(pool, prims.size(), kItemsBetweenAsking, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      keys[i] = std::uint64_t{grid.code(MortonGrid::center(Box4::load(&prims[i])))} << 32 | i;
    }
  });
  sorted_ = radix_sort(keys, second, 32, kMortonBits, pool, cancel);
  const Float4 scale(scale_of(bounds.boxes)), zero(0.0f);  // -0 + 0 is +0
  const BoxesAlongCurve boxes = make_room_for_clusters(prims.size(), scratch_);
  for_chunks(pool, prims.size(), kItemsBetweenAsking, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Box4 box = Box4::load(&prim(i));
      const auto code = static_cast<std::uint32_t>(sorted_[i] >> 32);
      boxes[i] = make_cluster({box.lower.xyz0() * scale + zero, box.upper.xyz0() * scale + zero}, code, code);
    }
  });
  tree_ = cluster_along_curve(boxes, pool, cancel);
  scratch_.trim(boxes.clusters, tree_.top.end);
}

}  // namespace perfect_bvh
