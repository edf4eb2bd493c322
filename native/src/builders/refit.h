// Refitting: new boxes for a tree whose primitives moved (lecture, "Refitting"); trees over triangles are refitted in
// their wide form, see wide/wide_refit.h.
// In: a refittable tree and the primitives' new boxes by number. Out: the same topology, tight boxes.
#pragma once

#include <span>

#include "builders/bvh2.h"
#include "builders/primitives.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/aabb.h"

namespace perfect_bvh {

// One box for each number that the tree refers to. Throws InvalidArgument if the tree is not refittable.
void refit_bvh2(Bvh2& tree, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
