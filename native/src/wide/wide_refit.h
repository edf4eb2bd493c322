// Refitting the tree that rays are traced through (lecture, "Refitting"): new boxes and leaves for triangles that
// moved, from the leaves up. No binary tree is needed. In: a wide tree and the mesh as it is now. Out: a tree of the
// same shape, tight and right; its cost.
#pragma once

#include <optional>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "wide/refit_plan.h"
#include "wide/wide_bvh.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {

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
