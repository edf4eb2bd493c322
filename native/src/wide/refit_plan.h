// What every refit of trees of one shape goes by, made once: in which order it writes nodes and leaves, and what it
// reads for the leaves.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/triangle_mesh.h"
#include "wide/bottom_up.h"
#include "wide/leaf_vertices.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

struct RefitOrder {
  BottomUpOrder nodes;
  std::vector<std::vector<std::uint32_t>> leaves;  // below each subtree, in the order in which its nodes ask for them
  std::vector<std::uint32_t> upper_leaves;         // likewise
};

// Either part may be missing (null): the order is spoilt by whatever moves nodes, the vertices only by new leaves.
struct RefitPlan {
  std::shared_ptr<const RefitOrder> order;
  std::shared_ptr<const LeafVertices> vertices;

  [[nodiscard]] std::size_t byte_count() const noexcept;
};

// Makes the parts that are missing. Throws Cancelled, bad_alloc.
void complete_plan(RefitPlan& plan, const WideBvh& tree, const TriangleMesh& mesh, ThreadPool& pool,
                   CancelToken& cancel);

}  // namespace perfect_bvh
