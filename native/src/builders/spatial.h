// SAH construction with spatial splits (Stich, Friedrich, Dietrich 2009, "Spatial splits in bounding volume
// hierarchies"): where the halves of an object split would overlap, space is cut instead, and what crosses the plane
// goes to both sides with the boxes of its parts. For static scenery (lecture, "The top-level BVH"): the boxes fit these
// positions alone.
// In: references, settings (bins, costs, duplication budget), a clipper. Out: a tree that is not refittable, in which a
// primitive may be in several leaves, never twice in one; every point of it is in the box of one of them.
#pragma once

#include <span>

#include "builders/build_config.h"
#include "builders/bvh2.h"
#include "builders/prim_clipper.h"
#include "builders/prim_ref.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// `prims` is not empty; `config` has been checked. Without a clipper primitives are taken to fill their boxes.
[[nodiscard]] Bvh2 build_spatial(std::span<const PrimRef> prims, const BuildConfig& config, const PrimClipper* clipper,
                                 ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
