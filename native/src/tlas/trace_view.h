// What kernels see of a snapshot.
#pragma once

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "tlas/snapshot.h"

namespace perfect_bvh {

// The row of a placed instance. Its tree may be stored in a scale of its own; the world's comes in later.
[[nodiscard]] InstanceView view_of(const Instance& instance, const Affine& world_to_object);

// Fills in `view` and brings `instance_views` to the world's scale, after everything else of the
// snapshot is in place.
void make_trace_view(Snapshot& snapshot, ThreadPool& pool, CancelToken& cancel);

// Calls trace(view) for a snapshot's view. Asks `cancel` before and, every so many steps, within: its callback may cast
// rays through the same snapshot. Throws Cancelled.
template <class Trace>
void with_view(const Snapshot& snapshot, CancelToken& cancel, Trace&& trace) {
  cancel.checkpoint();
  SceneView view = snapshot.view;
  view.interruption = {[](void* token) noexcept { return static_cast<CancelToken*>(token)->ask(); }, &cancel};
  trace(view);
  cancel.throw_if_stopped();
}

}  // namespace perfect_bvh
