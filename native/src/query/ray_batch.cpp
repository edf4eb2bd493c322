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
  const bool counted = out.nodes_visited || out.primitives_tested;
  std::atomic<std::size_t> packet_count{0};
  const auto trace = [&](std::span<const Ray> rays, std::size_t first) {
    AlignedVector<Hit> hits(rays.size());
    AlignedVector<RayCounts> counts(counted ? rays.size() : 0);
    packet_count.fetch_add(trace_closest(snapshot, cancel, rays, hits, columns.cull, counts, columns.strategy),
                           std::memory_order_relaxed);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      store_hit(out, first + i, snapshot, hits[i], rays[i]);
      if (out.nodes_visited) out.nodes_visited[first + i] = static_cast<std::int32_t>(counts[i].nodes_visited);
      if (out.primitives_tested)
        out.primitives_tested[first + i] = static_cast<std::int32_t>(counts[i].primitives_tested);
    }
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
