#include "wide/refit_plan.h"

#include <span>

namespace perfect_bvh {
namespace {

// Nodes from the last to the first, their places in turn.
std::vector<std::uint32_t> list_leaves(const WideBvh& tree, std::span<const std::uint32_t> rows) {
  std::vector<std::uint32_t> leaves;
  leaves.reserve(6 * rows.size());
  for (std::size_t i = rows.size(); i-- > 0;) {
    for (const std::uint32_t child : tree.nodes[rows[i]].child) {
      if (child >= kBlockChild) leaves.push_back(child - kBlockChild);
    }
  }
  return leaves;
}

RefitOrder order_refit(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel) {
  RefitOrder order{order_bottom_up(tree, pool, cancel), {}, {}};
  order.leaves.resize(order.nodes.subtrees.size());
  parallel_for(pool, order.leaves.size(), 1, [&](std::size_t begin, std::size_t end) {
    cancel.checkpoint();
    for (std::size_t i = begin; i < end; ++i) order.leaves[i] = list_leaves(tree, order.nodes.subtrees[i]);
  });
  order.upper_leaves = list_leaves(tree, order.nodes.upper);
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

void complete_plan(RefitPlan& plan, const WideBvh& tree, const TriangleMesh& mesh, ThreadPool& pool,
                   CancelToken& cancel) {
  if (!plan.order) plan.order = std::make_shared<const RefitOrder>(order_refit(tree, pool, cancel));
  if (!plan.vertices) {
    plan.vertices = std::make_shared<const LeafVertices>(list_leaf_vertices(tree, mesh, pool, cancel));
  }
}

}  // namespace perfect_bvh
