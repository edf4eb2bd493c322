#include "wide/wide_cost.h"

#include "wide/bottom_up.h"
#include "wide/wide_boxes.h"

namespace perfect_bvh {

WideCosts measure_wide_costs(const WideBvh& tree, ThreadPool& pool, CancelToken& cancel) {
  WideCosts costs;
  costs.resize(tree.nodes.size());
  visit_bottom_up(tree, pool, cancel, [&](std::span<const std::uint32_t> rows) {
    for (std::size_t i = rows.size(); i-- > 0;) {
      const WideNode& node = tree.nodes[rows[i]];
      costs.set(rows[i], node, node_box(node).half_area());
    }
  });
  return costs;
}

}  // namespace perfect_bvh
