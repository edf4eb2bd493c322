#include "wide/wide_rotation.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <utility>
#include <vector>

#include "wide/bottom_up.h"
#include "wide/visit_order.h"
#include "wide/wide_boxes.h"

namespace perfect_bvh {
namespace {

// Boxes of a node's children in registers, and whom they refer to.
struct Family {
  std::array<Box4, kWideWidth> boxes;
  std::array<std::uint32_t, kWideWidth> child;
  std::uint32_t count = 0;
};

Family family_of(const WideNode& node) noexcept {
  Family family;
  family.count = child_count(node);
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
    const Aabb box = child_box(node, lane);
    family.boxes[lane] = {Float4(box.lower.x, box.lower.y, box.lower.z, 0),
                          Float4(box.upper.x, box.upper.y, box.upper.z, 0)};
    family.child[lane] = node.child[lane];
  }
  return family;
}

void write_family(const Family& family, WideNode& node) noexcept {
  write_planes(family.boxes.data(), node);
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) node.child[lane] = family.child[lane];
  set_visit_order(node, family.count);
}

Box4 box_around(const Family& family) noexcept {
  Box4 box = Box4::empty();
  for (std::uint32_t lane = 0; lane < family.count; ++lane) box.grow(family.boxes[lane]);
  return box;
}

// For each child of a node the box around all the others; empty places have that around all.
class Others {
 public:
  explicit Others(const Family& family) noexcept {
    std::array<Box4, kWideWidth> after;
    Box4 box = Box4::empty();
    for (std::uint32_t lane = kWideWidth; lane-- > 0;) {
      after[lane] = box;
      if (lane < family.count) box.grow(family.boxes[lane]);
    }
    box = Box4::empty();
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      after[lane].grow(box);
      if (lane < family.count) box.grow(family.boxes[lane]);
    }
    write_planes(after.data(), planes_);
  }

  // Half the surfaces of those boxes, each grown by `box`.
  [[nodiscard]] std::array<float, kWideWidth> areas_with(const Box4& box) const noexcept {
    alignas(16) float corners[8];
    box.lower.store(&corners[0]);
    box.upper.store(&corners[4]);
    alignas(16) std::array<float, kWideWidth> areas;
    for (std::uint32_t first = 0; first < kWideWidth; first += 4) {
      const auto extent = [&](std::uint32_t axis) {
        return max(Float4::load(&planes_.planes[2 * axis + 1][first]), Float4(corners[4 + axis])) -
               min(Float4::load(&planes_.planes[2 * axis][first]), Float4(corners[axis]));
      };
      const Float4 x = extent(0), y = extent(1), z = extent(2);
      (x * y + (y * z + z * x)).store(&areas[first]);
    }
    return areas;
  }

 private:
  WideNode planes_;
};

// `child` of the node, or its first free place, and place `place` of its child `into` are exchanged.
struct Move {
  float gain = 0;  // of half surface
  std::uint32_t child = 0, into = 0, place = 0;
};

class Rotator {
 public:
  Rotator(WideBvh& tree, WideCosts& costs) noexcept : tree_(tree), costs_(costs) {}

  // Everything below has been visited. Returns the number of moves.
  std::size_t visit(std::uint32_t row) {
    Family family = family_of(tree_.nodes[row]);
    std::size_t moves = 0;
    while (moves < kMostMoves) {
      const Move move = find_best(family);
      if (!(move.gain > 0)) break;
      apply(move, family);
      ++moves;
    }
    if (moves > 0) write_family(family, tree_.nodes[row]);
    costs_.set(row, tree_.nodes[row], half_area(box_around(family).extent()));
    return moves;
  }

 private:
  static constexpr std::size_t kMostMoves = 4;  // at a node: more find little
  static constexpr float kLeastGain =
      1.0f / 256;  // of the box that shrinks: moves for less are not worth their writing

  [[nodiscard]] Move find_best(const Family& family) const noexcept {
    Move best;
    for (std::uint32_t into = 0; into < family.count; ++into) {
      if (family.child[into] >= kBlockChild) continue;
      const Family below = family_of(tree_.nodes[family.child[into]]);
      const Others others(below);
      const float area = half_area(family.boxes[into].extent());
      // The first free place will do; but no node is left with a single child.
      const std::uint32_t end = family.count < kWideWidth && below.count > 2 ? family.count + 1 : family.count;
      for (std::uint32_t child = 0; child < end; ++child) {
        if (child == into) continue;
        const std::array<float, kWideWidth> areas = others.areas_with(family.boxes[child]);
        for (std::uint32_t place = 0; place < below.count; ++place) {
          const float gain = area - areas[place];
          if (gain > best.gain && gain > kLeastGain * area) best = {gain, child, into, place};
        }
      }
    }
    return best;
  }

  void apply(const Move& move, Family& family) {
    const std::uint32_t row = family.child[move.into];
    Family below = family_of(tree_.nodes[row]);
    std::swap(below.boxes[move.place], family.boxes[move.child]);
    std::swap(below.child[move.place], family.child[move.child]);
    if (move.child == family.count) {
      ++family.count;
      --below.count;
      std::swap(below.boxes[move.place], below.boxes[below.count]);
      std::swap(below.child[move.place], below.child[below.count]);
    }
    family.boxes[move.into] = box_around(below);
    write_family(below, tree_.nodes[row]);
    costs_.set(row, tree_.nodes[row], half_area(family.boxes[move.into].extent()));
  }

  WideBvh& tree_;
  WideCosts& costs_;
};

// Of the nodes below each one and its own, as `depth` counts them.
std::uint32_t depth_of(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel) {
  std::vector<std::uint32_t> heights(tree.nodes.size());
  visit_bottom_up(tree, pool, cancel, [&](std::span<const std::uint32_t> rows) {
    for (std::size_t i = rows.size(); i-- > 0;) {
      std::uint32_t highest = 0;
      for (const std::uint32_t child : tree.nodes[rows[i]].child) {
        if (child != kNoChild && child < kBlockChild) highest = std::max(highest, heights[child]);
      }
      heights[rows[i]] = highest + 1;
    }
  });
  return tree.nodes.empty() ? 0 : heights[tree.root];
}

}  // namespace

std::size_t rotate_wide(WideBvh& tree, WideCosts& costs, ThreadPool& pool, CancelToken& cancel) {
  Rotator rotator(tree, costs);
  std::atomic<std::size_t> moves{0};
  visit_bottom_up(tree, pool, cancel, [&](std::span<const std::uint32_t> rows) {
    std::size_t here = 0;
    for (std::size_t i = rows.size(); i-- > 0;) here += rotator.visit(rows[i]);
    moves.fetch_add(here, std::memory_order_relaxed);
  });
  if (moves > 0) tree.depth = depth_of(tree, pool, cancel);
  return moves;
}

}  // namespace perfect_bvh
