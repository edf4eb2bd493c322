// What kernels see of a snapshot.
#pragma once

#include "core/cancel.h"
#include "scene/snapshot.h"

namespace perfect_bvh {

// Fills in `top_level`, `instance_views` and `view`, after everything else of the snapshot is in place.
void make_trace_view(Snapshot& snapshot, CancelToken& cancel);

}  // namespace perfect_bvh
