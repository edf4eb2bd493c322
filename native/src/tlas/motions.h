// What moves within the shutter, in a snapshot that is being put together: the kernels' views of it, and the boxes of
// its instances at the steps of the top level.
#pragma once

#include <span>
#include <vector>

#include "builders/primitives.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "tlas/snapshot.h"

namespace perfect_bvh {

// By step, then by the instance's row.
using StepBoxes = std::vector<AlignedVector<PrimRef>>;

// The instances are placed, with their turns and their meshes; `boxes` are their world boxes at the shutter's opening,
// and become those of all their ways. Fills in the instances' and views' motions, and widens the snapshot's bounds.
// Empty, and nothing done, if nothing moves. Throws Cancelled, bad_alloc.
[[nodiscard]] StepBoxes add_motions(Snapshot& snapshot, std::span<PrimRef> boxes, ThreadPool& pool,
                                    CancelToken& cancel);

}  // namespace perfect_bvh
