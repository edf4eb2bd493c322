#include "wide/fast_wide.h"

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "builders/locally_ordered.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/errors.h"
#include "wide/bottom_up.h"
#include "wide/collapse.h"
#include "wide/leaf_block.h"
#include "wide/run_cutter.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

// A run's vertices, each once, the index of every corner among them, and the triangles' numbers. The cutter has noted
// how long ago a corner's vertex occurred. A loop of unpredictable length costs as much as all else here, so there is
// only one.
struct RunContents {
  std::array<std::uint32_t, kLeafSize + 1> vertices;
  std::uint32_t vertex_count = 0;
  alignas(16) std::array<std::int32_t, kLeafSize> numbers;  // signed: compared by SSE2
  std::array<std::uint32_t, kLeafSize> corners;

  RunContents(const Mesh& mesh, const TriangleOrder& order, std::size_t first, std::uint32_t size,
              const std::uint32_t* corner_vertices, const std::uint8_t* way_back) noexcept {
    numbers.fill(std::numeric_limits<std::int32_t>::max());
    const Vec3f* const positions = mesh.positions.data();
    std::array<std::uint8_t, kMostBack + 3 * kLeafSize> places_of;
    std::uint8_t* const place_of = places_of.data() + kMostBack;  // entries before it can be read too
    const auto place = [&](std::uint32_t corner) {
      const std::uint32_t back = way_back[corner], vertex = corner_vertices[corner];
      __builtin_prefetch(positions + corner_vertices[corner + kCornersAhead]);
      const bool is_new = back > corner;
      const std::uint32_t result = is_new ? vertex_count : *(place_of + corner - back);
      place_of[corner] = static_cast<std::uint8_t>(result);
      vertices[result] = vertex;
      vertex_count += is_new;
      return result;
    };
    for (std::uint32_t triangle = 0; triangle < size; ++triangle) {
      const std::uint32_t x = place(3 * triangle), y = place(3 * triangle + 1), z = place(3 * triangle + 2);
      corners[triangle] = x | y << 4 | z << 8;
      numbers[triangle] = static_cast<std::int32_t>(order.triangle(first + triangle));
    }
    for (std::uint32_t i = 0; i < kLeafSize; ++i) vertices[i] = vertices[std::min(i, vertex_count - 1)];
  }
};

// Fills the block's rows in the order of the triangles' numbers; the last is repeated.
void write_triangles(LeafBlock& block, const RunContents& run, std::uint32_t size) noexcept {
  const Int4 low = Int4::load(&run.numbers[0]), high = Int4::load(&run.numbers[4]);
  Int4 low_ranks(0), high_ranks(0);
  const auto rank_above = [&](std::size_t i) {
    const Int4 number(run.numbers[i]);
    low_ranks = low_ranks - greater(low, number);
    high_ranks = high_ranks - greater(high, number);
  };
  rank_above(0), rank_above(1), rank_above(2), rank_above(3);
  rank_above(4), rank_above(5), rank_above(6), rank_above(7);
  alignas(16) std::array<std::uint32_t, kLeafSize> ranks;
  low_ranks.store(&ranks[0]), high_ranks.store(&ranks[4]);
  // The triangle of each rank, one digit (4 bits) per rank. Digits past the size are meaningless.
  std::uint32_t order = 0;
  for (std::uint32_t i = 0; i < kLeafSize; ++i) order += i << (4 * ranks[i]);
  const std::uint32_t last = (order >> (4 * (size - 1))) & 7;
  const Int4 last_number(run.numbers[last]), last_corners(static_cast<std::int32_t>(run.corners[last]));
  last_number.store(&block.primitives[0]), last_number.store(&block.primitives[4]);
  last_corners.store(&block.corners[0]), last_corners.store(&block.corners[4]);
  for (std::uint32_t i = 0; i < size; ++i) {
    block.primitives[ranks[i]] = static_cast<std::uint32_t>(run.numbers[i]);
    block.corners[ranks[i]] = run.corners[i];
  }
}

// Makes a box independent of which of its zeros came first: -0 + 0 is 0.
[[nodiscard]] Box4 with_positive_zeros(const Box4& box) noexcept {
  const Float4 zero(0.0f);
  return {box.lower + zero, box.upper + zero};
}

// Cuts in as many parts as there are threads, because each needs memory for all vertices.
void cut_runs(const Mesh& mesh, const TriangleOrder& order, Runs& runs, Scratch& scratch, ThreadPool& pool,
              CancelToken& cancel) {
  const std::size_t chunk_count = runs.counts.size();
  const auto threads = static_cast<std::size_t>(pool.thread_count());
  const std::size_t part = (chunk_count + threads - 1) / threads;
  const std::size_t vertex_count = runs.way_back.empty() ? 0 : mesh.positions.size();
  const auto last_corners = scratch.take<std::uint32_t>((chunk_count + part - 1) / part * vertex_count);
  for_chunks(pool, chunk_count, part, cancel, [&](std::size_t begin, std::size_t end) {
    RunCutter cutter(mesh, order, last_corners.subspan(begin / part * vertex_count, vertex_count), runs, cancel);
    for (std::size_t i = begin; i < end; ++i) {
      cancel.checkpoint();
      cutter.cut(i * kRunChunk, std::min(mesh.primitive_count(), (i + 1) * kRunChunk));
    }
  });
}

// Fills the leaves of the chunk whose first triangle is at position `begin`, from row `row` on.
void fill_leaves(TriangleTraits, const Mesh& mesh, const TriangleOrder& order, std::size_t begin,
                 std::span<const std::uint8_t> sizes, const Runs& runs, std::size_t row,
                 MortonLeaves& leaves) noexcept {
  for (const std::uint8_t size : sizes) {
    LeafBlock& block = leaves.tree.blocks[row];
    const RunContents run(mesh, order, begin, size, &runs.corners[3 * begin], &runs.way_back[3 * begin]);
    write_triangles(block, run, size);
    const Box4 box = write_vertices(block, run.vertices.data(), mesh, leaves.tree.scale);
    leaves.boxes[row++] = make_cluster(with_positive_zeros(box), order.code(begin), order.code(begin + size - 1));
    begin += size;
  }
}

// The same for kinds whose leaves hold no vertices.
template <class Kind>
void fill_leaves(Kind kind, const Mesh& mesh, const TriangleOrder& order, std::size_t begin,
                 std::span<const std::uint8_t> sizes, const Runs& /*runs*/, std::size_t row,
                 MortonLeaves& leaves) noexcept {
  for (const std::uint8_t size : sizes) {
    std::array<std::uint32_t, kLeafSize> numbers;
    Aabb box;
    for (std::size_t i = 0; i < size; ++i) {
      numbers[i] = order.triangle(begin + i);
      box.grow(Kind::box(mesh, numbers[i]));
    }
    leaves_of(kind, leaves.tree)[row] = make_leaf(kind, numbers.data(), size, mesh, leaves.tree.scale);
    const Float4 scale(leaves.tree.scale);
    const Box4 scaled{load_xyz(&box.lower) * scale, load_xyz(&box.upper) * scale};
    leaves.boxes[row++] = make_cluster(with_positive_zeros(scaled), order.code(begin), order.code(begin + size - 1));
    begin += size;
  }
}

void check_count(std::size_t count, bool has_corners) {
  constexpr std::size_t kMostNumbers = std::numeric_limits<std::int32_t>::max();
  const std::size_t most = has_corners ? std::min(kMostNumbers, kMostCutTriangles) : kMostNumbers;
  if (count <= most) return;
  throw EngineError("the fast builder takes at most " + std::to_string(most) + " primitives of this kind, got " +
                    std::to_string(count) + "; choose another builder, or divide the mesh");
}

}  // namespace

MortonLeaves make_morton_leaves(const Mesh& mesh, Scratch& tree_memory, ThreadPool& pool, CancelToken& cancel) {
  const std::size_t count = mesh.primitive_count();
  check_count(count, !mesh.triangles.empty());
  const std::size_t vertex_memory = mesh.positions.size() * sizeof(std::uint32_t);  // per thread
  Scratch scratch;
  scratch.expect(order_byte_count(count) + count + 15 * mesh.triangles.size() + vertex_memory);
  const TriangleOrder order = order_triangles(mesh, scratch, pool, cancel);
  MortonLeaves leaves;
  leaves.bounds = to_aabb(order.bounds);
  leaves.tree.scale = tree_scale(leaves.bounds);

  Runs runs = make_room_for_runs(mesh, scratch);
  cut_runs(mesh, order, runs, scratch, pool, cancel);
  std::vector<std::size_t> first_leaves(runs.counts.size() + 1);
  for (std::size_t i = 0; i < runs.counts.size(); ++i) first_leaves[i + 1] = first_leaves[i] + runs.counts[i];
  if (first_leaves.back() > kMostBlocks) throw EngineError("the mesh has more leaves than a tree can refer to");
  make_room_for_leaves(mesh, first_leaves.back(), leaves.tree);
  leaves.boxes = make_room_for_clusters(first_leaves.back(), tree_memory);
  for_chunks(pool, count, kRunChunk, cancel, [&](std::size_t begin, std::size_t end) {
    const std::size_t chunk = begin / kRunChunk, row = first_leaves[chunk];
    const auto sizes = runs.sizes.subspan(begin, runs.counts[chunk]);
    with_kind(mesh.kind, [&](auto kind) { fill_leaves(kind, mesh, order, begin, sizes, runs, row, leaves); });
    cancel.advance(2 * (end - begin));  // the rest takes little time: there is no binary tree
  });
  return leaves;
}

// Fast wide -----------------------------------------------------------------------------------------------------------

namespace {

struct Child {
  std::uint32_t cluster;
  std::uint32_t row, lane;  // where to write the reference to it
  std::uint32_t depth;      // of the node that it becomes
};

constexpr std::uint32_t kNoParent = ~0u;  // `row` of the root

// Finds the children of a wide node, according to the plan.
class Spreader {
 public:
  Spreader(const ClusterTree& tree, std::span<const PlacesPlan> plans) noexcept
      : tree_(tree), plans_(plans), leaf_count_(tree.box_count) {}

  void spread(std::uint32_t cluster) noexcept {
    count_ = 0;
    const std::uint32_t to_left = plans_[cluster - leaf_count_].to_left(1);
    spread(tree_.clusters[cluster].left, to_left);
    spread(tree_.clusters[cluster].right, kWideWidth - to_left);
  }

  [[nodiscard]] std::uint32_t count() const noexcept { return count_; }
  [[nodiscard]] std::uint32_t child(std::uint32_t lane) const noexcept { return children_[lane]; }
  [[nodiscard]] bool is_leaf(std::uint32_t lane) const noexcept { return children_[lane] < leaf_count_; }
  [[nodiscard]] Box4 box(std::uint32_t lane) const noexcept { return tree_.clusters[children_[lane]].box(); }

 private:
  void spread(std::uint32_t cluster, std::uint32_t places) noexcept {
    const std::uint32_t to_left =
        places == 1 || cluster < leaf_count_ ? 0 : plans_[cluster - leaf_count_].to_left(places);
    if (to_left == 0) {
      children_[count_++] = cluster;
      return;
    }
    spread(tree_.clusters[cluster].left, to_left);
    spread(tree_.clusters[cluster].right, places - to_left);
  }

  const ClusterTree& tree_;
  std::span<const PlacesPlan> plans_;
  std::uint32_t leaf_count_;
  std::array<std::uint32_t, kWideWidth> children_;
  std::uint32_t count_ = 0;
};

// Goes through the planned wide nodes, depth first.
class Walk {
 public:
  Walk(const ClusterTree& tree, std::span<const PlacesPlan> plans) noexcept : spreader_(tree, plans) {}

  // Calls body(now, node's children, row) for everything below `root`, counting rows from `row` on. Clusters numbered
  // below `end` are not visited but added to `left`. Returns the first free row.
  template <class Body>
  std::uint32_t run(const Child& root, std::uint32_t end, std::uint32_t row, std::vector<Child>& left,
                    CancelToken& cancel, const Body& body) {
    waiting_.assign(1, root);
    for (Steps steps(cancel); !waiting_.empty(); steps.step(), ++row) {
      const Child now = waiting_.back();
      waiting_.pop_back();
      spreader_.spread(now.cluster);
      body(now, spreader_, row);
      for (std::uint32_t lane = spreader_.count(); lane-- > 0;) {
        if (spreader_.is_leaf(lane)) continue;
        const Child child{spreader_.child(lane), row, lane, now.depth + 1};
        (child.cluster < end ? left : waiting_).push_back(child);
      }
    }
    return row;
  }

 private:
  Spreader spreader_;
  std::vector<Child> waiting_;
};

// leaf_child(cluster) returns the reference to a leaf.
template <class LeafChild>
void write_node(const Spreader& children, const LeafChild& leaf_child, WideNode& node) noexcept {
  std::array<Box4, kWideWidth> boxes;
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
    const bool is_taken = lane < children.count();
    boxes[lane] = is_taken ? children.box(lane) : Box4::empty();
    node.child[lane] = is_taken && children.is_leaf(lane) ? leaf_child(children.child(lane)) : kNoChild;
  }
  write_planes(boxes.data(), node);
  set_visit_order(node, children.count());
}

// Divides the subtrees among threads. They are first counted, then written to their final position.
class Assembly {
 public:
  Assembly(const ClusterTree& tree, std::span<const PlacesPlan> plans, ThreadPool& pool, CancelToken& cancel)
      : tree_(tree), plans_(plans), pool_(pool), cancel_(cancel) {}

  template <class LeafChild>
  void run(WideBvh& wide, const LeafChild& leaf_child) {
    const Child root{tree_.root, kNoParent, 0, 1};
    const std::vector<Group> groups = count(root);
    for (const Group& group : groups) wide.depth = std::max(wide.depth, group.depth);
    wide.nodes.resize(groups.back().end_row);
    WideNode* const nodes = wide.nodes.data();
    const auto write = [&leaf_child, nodes](const Child& now, const Spreader& children, std::uint32_t row) {
      if (now.row != kNoParent) nodes[now.row].child[now.lane] = row;
      write_node(children, leaf_child, nodes[row]);
    };
    std::vector<Child> below;
    static_cast<void>(Walk(tree_, plans_).run(root, tree_.top.begin, 0, below, cancel_, write));
    for_groups([&](Walk& walk, std::size_t group, std::span<const Child> subtrees) {
      std::uint32_t row = groups[group].end_row;  // of the previous group
      std::vector<Child> none;
      for (const Child& subtree : subtrees) row = walk.run(subtree, 0, row, none, cancel_, write);
    });
  }

 private:
  static constexpr std::size_t kGroup = 64;  // subtrees

  // The upper nodes, or those of some subtrees.
  struct Group {
    std::uint32_t end_row, depth;
  };

  // Finds the subtrees. The upper nodes come first.
  std::vector<Group> count(const Child& root) {
    std::uint32_t depth = 0;
    const std::uint32_t upper_count =
        Walk(tree_, plans_)
            .run(root, tree_.top.begin, 0, subtrees_, cancel_,
                 [&](const Child& now, const Spreader&, std::uint32_t) { depth = std::max(depth, now.depth); });
    std::vector<Group> groups((subtrees_.size() + kGroup - 1) / kGroup + 1);
    groups[0] = {upper_count, depth};
    for_groups([&](Walk& walk, std::size_t group, std::span<const Child> subtrees) {
      std::vector<Child> none;
      Group found{0, 0};
      for (const Child& subtree : subtrees) {
        found.end_row = walk.run(
            subtree, 0, found.end_row, none, cancel_,
            [&](const Child& now, const Spreader&, std::uint32_t) { found.depth = std::max(found.depth, now.depth); });
      }
      groups[group + 1] = found;
    });
    for (std::size_t i = 1; i < groups.size(); ++i) groups[i].end_row += groups[i - 1].end_row;
    return groups;
  }

  // body(walk, group's number, its subtrees)
  template <class Body>
  void for_groups(const Body& body) {
    for_chunks(pool_, subtrees_.size(), kGroup, cancel_, [&](std::size_t begin, std::size_t end) {
      Walk walk(tree_, plans_);
      body(walk, begin / kGroup, std::span<const Child>(subtrees_).subspan(begin, end - begin));
    });
  }

  const ClusterTree& tree_;
  std::span<const PlacesPlan> plans_;
  ThreadPool& pool_;
  CancelToken& cancel_;
  std::vector<Child> subtrees_;
};

}  // namespace

WideBvh build_fast_wide(const Mesh& mesh, ThreadPool& pool, CancelToken& cancel) {
  WideBvh wide;
  if (mesh.primitive_count() == 0) return wide;
  Scratch tree_memory;
  MortonLeaves leaves = make_morton_leaves(mesh, tree_memory, pool, cancel);
  wide = std::move(leaves.tree);
  wide.is_empty = false;
  wide.extent = tree_extent(leaves.bounds, wide.scale);
  if (wide.leaf_count() == 1) {
    wide.root = kBlockChild;
    return wide;
  }
  const ClusterTree tree = cluster_along_curve(leaves.boxes, pool, cancel);
  tree_memory.trim(leaves.boxes.clusters, tree.top.end);
  const auto plans = plan_places(tree, tree_memory, pool, cancel);
  Assembly(tree, plans, pool, cancel).run(wide, [](std::uint32_t leaf) { return kBlockChild + leaf; });
  wide.root = 0;
  return wide;
}

WideBvh build_fast_top_level(std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  const auto scale_of = [](const Box4& bounds) { return tree_scale(to_aabb(bounds)); };
  Curve curve(boxes, scale_of, pool, cancel);
  const auto instance = [&](std::uint32_t place) { return kInstanceChild + curve.prim(place).prim_index; };
  WideBvh wide;
  wide.is_empty = false;
  wide.scale = scale_of(curve.bounds());
  wide.extent = tree_extent(to_aabb(curve.bounds()), wide.scale);
  if (boxes.size() == 1) {
    wide.root = instance(0);
    return wide;
  }
  const auto plans = plan_places(curve.tree(), curve.scratch(), pool, cancel);
  Assembly(curve.tree(), plans, pool, cancel).run(wide, instance);
  wide.root = 0;
  return wide;
}

}  // namespace perfect_bvh
