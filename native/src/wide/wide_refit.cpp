#include "wide/wide_refit.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "core/cancel.h"
#include "core/errors.h"
#include "wide/collapse.h"
#include "wide/leaf_block.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kGrain = 4096, kAhead = 16;  // leaves
constexpr std::uint32_t kNone = ~0u;

void list_vertices(const LeafBlock& leaf, const TriangleIndices* triangles, VertexNumbers& numbers) noexcept {
  numbers.at.fill(kNone);
  for (std::uint32_t i = 0; i < 8; ++i) {
    const TriangleIndices corners = triangles[leaf.primitives[i]];
    const std::uint32_t places = leaf.corners[i];
    numbers.at[places & 7u] = corners.x;
    numbers.at[(places >> 4) & 7u] = corners.y;
    numbers.at[(places >> 8) & 7u] = corners.z;
  }
  // Unused slots repeat the last vertex.
  for (std::uint32_t i = 1; i < 8; ++i) numbers.at[i] = numbers.at[i] == kNone ? numbers.at[i - 1] : numbers.at[i];
}

LeafVertices list_leaf_vertices(const WideBvh& tree, const Mesh& mesh, ThreadPool& pool, CancelToken& cancel) {
  LeafVertices vertices(tree.blocks.size());
  const TriangleIndices* const triangles = mesh.triangles.data();
  for_chunks(pool, tree.blocks.size(), kGrain, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      if (row + kAhead < end) {
        for (const std::uint32_t primitive : tree.blocks[row + kAhead].primitives) {
          __builtin_prefetch(&triangles[primitive]);
        }
      }
      list_vertices(tree.blocks[row], triangles, vertices[row]);
    }
  });
  return vertices;
}

// Lists the leaves of the nodes from the last to the first, slot by slot.
std::vector<std::uint32_t> list_leaves(const WideBvh& tree, std::span<const std::uint32_t> rows, CancelToken& cancel) {
  std::vector<std::uint32_t> leaves;
  leaves.reserve(6 * rows.size());
  for_steps_back(rows.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = end; i-- > begin;) {
      for (const std::uint32_t child : tree.nodes[rows[i]].child) {
        if (child >= kBlockChild) leaves.push_back(child - kBlockChild);
      }
    }
  });
  return leaves;
}

RefitOrder order_refit(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel) {
  RefitOrder order{order_bottom_up(tree, pool, cancel), {}, {}};
  order.leaves.resize(order.nodes.subtrees.size());
  for_chunks(pool, order.leaves.size(), 1, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) order.leaves[i] = list_leaves(tree, order.nodes.subtrees[i], cancel);
  });
  order.upper_leaves = list_leaves(tree, order.nodes.upper, cancel);
  return order;
}

std::size_t count_rows(const std::vector<std::vector<std::uint32_t>>& lists) noexcept {
  std::size_t count = 0;
  for (const auto& list : lists) count += list.size();
  return count;
}

}  // namespace

std::size_t RefitPlan::byte_count() const noexcept {
  const std::size_t rows = order ? count_rows(order->nodes.subtrees) + order->nodes.upper.size() +
                                       count_rows(order->leaves) + order->upper_leaves.size()
                                 : 0;
  return rows * sizeof(std::uint32_t) + (vertices ? vertices->size() * sizeof(VertexNumbers) : 0);
}

void complete_plan(RefitPlan& plan, const WideBvh& tree, const Mesh& mesh, ThreadPool& pool, CancelToken& cancel) {
  if (!plan.order) plan.order = std::make_shared<const RefitOrder>(order_refit(tree, pool, cancel));
  if (!plan.vertices) {
    plan.vertices = std::make_shared<const LeafVertices>(list_leaf_vertices(tree, mesh, pool, cancel));
  }
}

// Wide refit ----------------------------------------------------------------------------------------------------------

namespace {

// One pass over a tree, with the scale that `to` has.
class Refitter {
 public:
  Refitter(const WideBvh& from, const RefitPlan& plan, const Mesh& mesh, WideBvh& to)
      : from_(from), order_(*plan.order), vertices_(*plan.vertices), mesh_(mesh), to_(to) {
    node_boxes_.resize(from.nodes.size());
    costs_.resize(from.nodes.size());
  }

  void run(ThreadPool& pool, CancelToken& cancel) {
    if (from_.root >= kBlockChild) {
      const std::uint32_t row = from_.root - kBlockChild;
      refit_leaves(from_, vertices_, mesh_, {&row, 1}, to_, &bounds_);
      return;
    }
    for_chunks(pool, order_.leaves.size(), 1, cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) refit_nodes(order_.nodes.subtrees[i], order_.leaves[i], cancel);
    });
    refit_nodes(order_.nodes.upper, order_.upper_leaves, cancel);
    bounds_ = node_boxes_[from_.root];
  }

  [[nodiscard]] const Box4& bounds() const noexcept { return bounds_; }  // as stored
  [[nodiscard]] WideCosts& costs() noexcept { return costs_; }

 private:
  // Refits all leaves of these nodes first, then the nodes, parents last.
  void refit_nodes(std::span<const std::uint32_t> rows, std::span<const std::uint32_t> leaves, CancelToken& cancel) {
    AlignedVector<Box4> leaf_boxes(leaves.size());
    for_steps(leaves.size(), cancel, [&](std::size_t begin, std::size_t end) {
      refit_leaves(from_, vertices_, mesh_, leaves.subspan(begin, end - begin), to_, leaf_boxes.data() + begin);
    });
    const Box4* next_leaf = leaf_boxes.data();
    constexpr std::size_t kNodesAhead = 4;
    for_steps_back(rows.size(), cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = end; i-- > begin;) {
        if (i >= kNodesAhead) fetch_node(rows[i - kNodesAhead]);
        refit_node(rows[i], next_leaf);
      }
    });
  }

  void fetch_node(std::uint32_t row) const noexcept {
    const char* const node = reinterpret_cast<const char*>(&to_.nodes[row]);
    for (std::size_t line = 0; line < sizeof(WideNode); line += kCacheLine) __builtin_prefetch(node + line, 1);
  }

  // `next_leaf` points to the boxes of the node's leaves.
  void refit_node(std::uint32_t row, const Box4*& next_leaf) {
    const WideNode& shape = from_.nodes[row];
    WideNode& node = to_.nodes[row];
    std::array<Box4, kWideWidth> boxes;
    Box4 box = Box4::empty();
    std::uint32_t count = 0;
    for (; count < kWideWidth && shape.child[count] != kNoChild; ++count) {
      boxes[count] = shape.child[count] < kBlockChild ? node_boxes_[shape.child[count]] : *next_leaf++;
      box.grow(boxes[count]);
    }
    std::fill(boxes.begin() + count, boxes.end(), Box4::empty());
    node_boxes_[row] = box;
    if (&node != &shape) std::copy_n(shape.child, kWideWidth, node.child);
    write_planes(boxes.data(), node);
    set_visit_order(node, count);
    costs_.set(row, node, half_area(box.extent()));
  }

  const WideBvh& from_;
  const RefitOrder& order_;
  const LeafVertices& vertices_;
  const Mesh& mesh_;
  WideBvh& to_;
  AlignedVector<Box4> node_boxes_;  // by row
  Box4 bounds_ = Box4::empty();
  WideCosts costs_;
};

Aabb in_mesh(const Box4& stored, float scale) noexcept {
  const Aabb box = to_aabb(stored);
  return {box.lower * (1.0f / scale), box.upper * (1.0f / scale)};
}

// Coordinates that left the range of a scale have lost their values, so the scale is computed from the mesh.
float scale_of(const Mesh& mesh, CancelToken& cancel) {
  Aabb box;
  for_steps(mesh.primitive_count(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) box.grow(mesh.primitive_box(i));
  });
  return tree_scale(box);
}

}  // namespace

WideCosts refit_wide(const WideBvh& from, const RefitPlan& plan, const Mesh& mesh, WideBvh& to, bool has_shape,
                     ThreadPool& pool, CancelToken& cancel, std::optional<float> scale) {
  if (!is_refittable(from)) {
    throw InvalidArgument("refit_wide: the tree's boxes are clipped (spatial splits), so it must be rebuilt instead");
  }
  cancel.throw_if_stopped();
  to.nodes.resize(from.nodes.size());
  for_each_kind([&](auto kind) { leaves_of(kind, to).resize(leaves_of(kind, from).size()); });
  to.root = from.root, to.depth = from.depth, to.is_empty = from.is_empty, to.repeats_triangles = false;
  to.scale = scale.value_or(from.scale), to.extent = from.extent;
  if (from.is_empty) return {};
  // The shape is read from `to` if it has it: that memory is closer, as it is about to be written.
  const WideBvh& shape = has_shape ? to : from;
  Refitter refitter(shape, plan, mesh, to);
  refitter.run(pool, cancel);
  if (!scale && tree_scale(in_mesh(refitter.bounds(), to.scale)) != to.scale) {
    to.scale = scale_of(mesh, cancel);
    refitter.run(pool, cancel);
  }
  to.extent = tree_extent(in_mesh(refitter.bounds(), to.scale), to.scale);
  return std::move(refitter.costs());
}

}  // namespace perfect_bvh
