// Refitting: new boxes for a tree whose primitives moved (lecture, "Refitting").
// In: a refittable tree and the primitives' new boxes by number. Out: the same topology, tight boxes.
#pragma once

#include <span>

#include "build/bvh2.h"
#include "build/prim_ref.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/aabb.h"

namespace perfect_bvh {

// Throws InvalidArgument if the tree is not refittable.
void refit_bvh2(Bvh2& tree, std::span<const Vec3f> positions, std::span<const Vec3<std::uint32_t>> triangles,
                ThreadPool& pool, CancelToken& cancel);
// The same over ready-made boxes (the top level), one for each number that the tree refers to.
void refit_bvh2(Bvh2& tree, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
