// What kernels see of a snapshot.
#pragma once

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "tlas/snapshot.h"

namespace perfect_bvh {

// The row of a placed instance. Its tree may be stored in a scale of its own; the world's comes in later.
[[nodiscard]] InstanceView view_of(const Instance& instance, const Affine& world_to_object);

// The same instance, seen in a tree that its mesh got later; in the world's scale.
[[nodiscard]] InstanceView view_of_built(const Instance& instance, const Blas& built, float world_scale);

// Makes room in the view for rays to go through a tree.
void admit_tree(SceneView& view, const WideBvh& top_level, const WideBvh& tree);

// Fills in `view` and brings `instance_views` to the world's scale, after everything else of the
// snapshot is in place.
void make_trace_view(Snapshot& snapshot, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
