#include "query/ray_batch.h"

#include <atomic>

#include "query/trace.h"

namespace perfect_bvh {
namespace {

std::size_t block_rays(const RayColumns& columns) {
  return columns.strategy == Strategy::kAuto ? large_block_rays(columns.count) : kBlockRays;
}

}  // namespace

BatchSummary cast_rays(const Snapshot& snapshot, const RayColumns& columns, const HitColumns& out, ThreadPool& pool,
                       int max_threads, CancelToken& cancel) {
  std::atomic<std::size_t> packet_count{0};
  const auto trace = [&](std::span<const Ray> rays, std::size_t first) {
    KeptByThread<AlignedVector<Hit>> kept_hits;
    KeptByThread<AlignedVector<RayCounts>> kept_counts;
    const std::span<Hit> hits = room_for(*kept_hits, rays.size());
    const std::span<RayCounts> counts = room_for(*kept_counts, out.want_counts() ? rays.size() : 0);
    packet_count.fetch_add(trace_closest(snapshot, cancel, rays, hits, columns.cull, counts, columns.strategy),
                           std::memory_order_relaxed);
    store_hits(out, first, snapshot, hits, rays);
    store_counts(out, first, counts);
  };
  const std::size_t invalid_count = for_each_block(columns, pool, max_threads, cancel, trace, block_rays(columns));
  return {invalid_count, packet_count.load()};
}

std::size_t test_occlusions(const Snapshot& snapshot, const RayColumns& columns, std::uint8_t* occluded,
                            ThreadPool& pool, int max_threads, CancelToken& cancel) {
  const auto trace = [&](std::span<const Ray> rays, std::size_t first) {
    trace_occluded(snapshot, cancel, rays, std::span(occluded + first, rays.size()), columns.cull, {},
                   columns.strategy);
  };
  return for_each_block(columns, pool, max_threads, cancel, trace, block_rays(columns));
}

}  // namespace perfect_bvh
