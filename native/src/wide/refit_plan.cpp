#include "wide/refit_plan.h"

#include <cstddef>
#include <span>

#include "core/steps.h"

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
  // Places to spare repeat the last vertex.
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

// Nodes from the last to the first, their places in turn.
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

}  // namespace perfect_bvh
