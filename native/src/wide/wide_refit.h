// What all refits of trees of one shape share, made once: the order in which they write nodes and leaves, and what they
// read for the leaves.
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

// Which vertices each leaf holds, place by place: what a refit reads instead of the leaf's triangles and theirs in the
// mesh, which halves the time of a leaf. 32 bytes a leaf, or 6 a triangle, of meshes that deform alone.
struct alignas(32) VertexNumbers {
  std::array<std::uint32_t, 8> at;  // in the mesh, by place in LeafBlock::vertices
};

// By row of the leaf; empty of curves and points, whose leaves hold no vertices. It holds for as long as the leaves
// are the same, whatever happens to the nodes above them.
using LeafVertices = AlignedVector<VertexNumbers>;

struct RefitOrder {
  BottomUpOrder nodes;
  std::vector<std::vector<std::uint32_t>> leaves;  // below each subtree, in the order in which its nodes ask for them
  std::vector<std::uint32_t> upper_leaves;         // likewise
};

// Either part may be missing (null): the order is invalidated by whatever moves nodes, the vertices only by new leaves.
struct RefitPlan {
  std::shared_ptr<const RefitOrder> order;
  std::shared_ptr<const LeafVertices> vertices;

  [[nodiscard]] std::size_t byte_count() const noexcept;
};

// Makes the parts that are missing. Throws Cancelled, bad_alloc.
void complete_plan(RefitPlan& plan, const WideBvh& tree, const Mesh& mesh, ThreadPool& pool, CancelToken& cancel);

// Wide refit ----------------------------------------------------------------------------------------------------------
// Refitting the tree that rays are traced through (lecture, "Refitting"): new boxes and leaves for triangles that
// moved, from the leaves up. No binary tree is needed. In: a wide tree and the mesh as it is now. Out: a tree of the
// same shape, tight and right; its cost.

// Trees that repeat triangles (spatial splits) have boxes around parts of triangles, which no refit can keep.
[[nodiscard]] inline bool is_refittable(const WideBvh& tree) noexcept { return !tree.repeats_triangles; }

// Writes to `to` what `from` becomes over the mesh's positions of now; `from` is only read. `plan` is that of `from`,
// complete. `has_shape`: `to` already
// is a tree with `from`'s nodes, leaves and their triangles, so that those need not be copied; otherwise its memory is
// used and its contents are not. Scale and extent follow the mesh, or the scale is the one that is asked for. The same
// bytes for any number of threads, and those of `from` where nothing moved. Throws InvalidArgument if the tree is not
// refittable; Cancelled, bad_alloc: `to` is then of no use.
WideCosts refit_wide(const WideBvh& from, const RefitPlan& plan, const Mesh& mesh, WideBvh& to, bool has_shape,
                     ThreadPool& pool, CancelToken& cancel, std::optional<float> scale = std::nullopt);

}  // namespace perfect_bvh
