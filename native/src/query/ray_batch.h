// Millions of rays at once: arrays in, arrays out, over the thread pool.
// In: columns that the caller owns. Out: the columns that were asked for, one row a ray, always.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "query/hit_columns.h"
#include "query/ray_columns.h"
#include "tlas/snapshot.h"

namespace perfect_bvh {

struct BatchSummary {
  std::size_t invalid_count = 0;  // see is_valid
  std::size_t packet_count = 0;   // rays that were traced in packets
};

// max_threads 0: all of the pool's.
BatchSummary cast_rays(const Snapshot& snapshot, const RayColumns& rays, const HitColumns& hits, ThreadPool& pool,
                       int max_threads, CancelToken& cancel);
// Returns how many rays were invalid.
std::size_t test_occlusions(const Snapshot& snapshot, const RayColumns& rays, std::uint8_t* occluded, ThreadPool& pool,
                            int max_threads, CancelToken& cancel);

}  // namespace perfect_bvh
