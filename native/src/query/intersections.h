// Everything that each ray of a batch meets: how often, and what.
// A triangle is reported once a ray, in however many leaves it stands. Rows of a ray are sorted by t, then (order, id,
// primitive): the first is what cast_rays() answers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "query/hit_columns.h"
#include "query/ray_columns.h"
#include "tlas/snapshot.h"

namespace perfect_bvh {

// One count a ray. Returns how many rays were invalid (see is_valid). max_threads 0: all of the pool's.
std::size_t count_intersections(const Snapshot& snapshot, const RayColumns& rays, std::int32_t* counts,
                                ThreadPool& pool, int max_threads, CancelToken& cancel);

// Ray i's hits go to rows splits[i] to splits[i + 1], the nearest of them if there is no room for all; there must not
// be room for more than there are. Returns as above.
std::size_t list_intersections(const Snapshot& snapshot, const RayColumns& rays, std::span<const std::int64_t> splits,
                               const HitColumns& hits, ThreadPool& pool, int max_threads, CancelToken& cancel);

}  // namespace perfect_bvh
