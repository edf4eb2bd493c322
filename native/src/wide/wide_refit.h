// Data that all refits of trees of one shape share, made once: the order in which they write nodes and leaves, and the
// vertex numbers of the leaves.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "wide/bottom_up.h"
#include "wide/wide_bvh.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {

// The vertex numbers of each leaf, by slot. A refit reads these instead of the leaf's triangles and their corners in
// the mesh, which halves the time of a leaf. They take 32 bytes per leaf, or 6 per triangle, and only exist for meshes
// that deform.
struct alignas(32) VertexNumbers {
  std::array<std::uint32_t, 8> at;  // in the mesh, by slot in LeafBlock::vertices
};

// By row of the leaf. Empty for curves and points, whose leaves hold no vertices. It stays valid while the leaves are
// the same, even if the nodes above them change.
using LeafVertices = AlignedVector<VertexNumbers>;

struct RefitOrder {
  BottomUpOrder nodes;
  std::vector<std::vector<std::uint32_t>> leaves;  // below each subtree, in the order in which its nodes read them
  std::vector<std::uint32_t> upper_leaves;         // the same for the upper nodes
};

// Either part may be missing (null). Moving nodes invalidates the order; only new leaves invalidate the vertices.
struct RefitPlan {
  std::shared_ptr<const RefitOrder> order;
  std::shared_ptr<const LeafVertices> vertices;

  [[nodiscard]] std::size_t byte_count() const noexcept;
};

// Makes the parts that are missing. Throws Cancelled, bad_alloc.
void complete_plan(RefitPlan& plan, const WideBvh& tree, const Mesh& mesh, ThreadPool& pool, CancelToken& cancel);

// Wide refit ----------------------------------------------------------------------------------------------------------
// Refits the tree that rays are traced through (lecture, "Refitting"): new boxes and leaves for triangles that moved,
// from the leaves up. No binary tree is needed. In: a wide tree and the present mesh. Out: a tree of the same shape
// with tight, correct boxes; its cost.

// Trees that repeat triangles (spatial splits) have boxes around parts of triangles, which a refit cannot keep.
[[nodiscard]] inline bool is_refittable(const WideBvh& tree) noexcept { return !tree.repeats_triangles; }

// Writes to `to` the tree `from`, refitted to the mesh's present positions; `from` is only read. `plan` is the complete
// plan of `from`. `has_shape`: `to` already is a tree with `from`'s nodes, leaves and triangles, so these are not
// copied; otherwise only the memory of `to` is reused. Scale and extent follow the mesh, unless `scale` is given. The
// same bytes for any number of threads, and equal to `from` where nothing moved. Throws InvalidArgument if the tree is
// not refittable. Throws Cancelled, bad_alloc; `to` is then unusable.
WideCosts refit_wide(const WideBvh& from, const RefitPlan& plan, const Mesh& mesh, WideBvh& to, bool has_shape,
                     ThreadPool& pool, CancelToken& cancel, std::optional<float> scale = std::nullopt);

}  // namespace perfect_bvh
