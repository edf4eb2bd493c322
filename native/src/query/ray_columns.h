// The rays of a batch as columns that the caller owns, and the loop over them.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "query/kept_by_thread.h"
#include "traverse/ray.h"
#include "traverse/ray_reordering.h"
#include "traverse/strategy.h"

namespace perfect_bvh {

// Float or double: exactly one of each pair of pointers is set. Strides count numbers: 3 from vector to vector of a
// plain array, 0 for one vector that all rays share; of numbers 1, or 0 for one that all share.
struct RayColumns {
  std::size_t count = 0;
  const Vec3f* origins_float = nullptr;
  const Vec3d* origins_double = nullptr;
  const Vec3f* directions_float = nullptr;
  const Vec3d* directions_double = nullptr;
  const float* t_min = nullptr;
  const float* t_max = nullptr;
  const std::uint32_t* masks = nullptr;
  const float* times = &kShutterOpens;  // within the shutter, 0 to 1
  std::ptrdiff_t origin_stride = 3, direction_stride = 3;
  std::size_t t_min_stride = 0, t_max_stride = 0, mask_stride = 0, time_stride = 0;
  Cull cull = Cull::kNone;
  Strategy strategy = Strategy::kAuto;  // of closest-hit and any-hit queries; the others know one
};

// The rays of rows `first` on, one for each of `rays`; returns how many are invalid.
std::size_t load_rays(const RayColumns& columns, std::size_t first, std::span<Ray> rays) noexcept;

[[nodiscard]] inline Ray load_ray(const RayColumns& columns, std::size_t row) noexcept {
  Ray ray;
  load_rays(columns, row, {&ray, 1});
  return ray;
}

// Rays a task takes at a time: enough to repay the hand-over, few enough to stop soon and to share out evenly.
inline constexpr std::size_t kTaskRays = 4096;
// Rays loaded at a time: enough to keep many under way to the end, few enough for the second level cache.
inline constexpr std::size_t kBlockRays = 1024;
// Where coherent rays are looked for, large batches are traced as many rays at a time as make good packets, several
// rows of an image, and leave room for the tree in the second level cache: they and their hits are 84 bytes each. With
// 8,192 coherent rays are as fast as with twice as many, and rays at random some hundredths faster. By the number of
// rays alone, so that all answers are.
inline constexpr std::size_t kLargeBlockRays = 8192;
static_assert(kLargeBlockRays <= kReorderedRays);
[[nodiscard]] inline std::size_t large_block_rays(std::size_t count) noexcept {
  return std::clamp(count / 16 / kPacketRays * kPacketRays, kBlockRays, kLargeBlockRays);
}

// Of a batch in blocks: whole blocks, and few enough that every thread has some tasks, also of a small batch.
[[nodiscard]] inline std::size_t fair_task_rays(std::size_t count, std::size_t block_rays,
                                                std::size_t threads) noexcept {
  const std::size_t most = std::max<std::size_t>(kTaskRays / block_rays, 1);
  return block_rays * std::clamp<std::size_t>(count / (2 * threads) / block_rays, 1, most);
}

// Calls run(begin, end) for every task's rows of a batch, over the pool.
template <class Run>
void for_each_task(std::size_t count, ThreadPool& pool, int max_threads, CancelToken& cancel, Run&& run,
                   std::size_t task_rays = kTaskRays) {
  cancel.expect(count);
  const auto task = [&](std::size_t begin, std::size_t end) {
    cancel.throw_if_stopped();
    run(begin, end);
    cancel.advance(end - begin);
  };
  parallel_for(pool, count, task_rays, task, max_threads, [&] { cancel.checkpoint(); });
}

// Calls block(rays, first row) for every block of `block_rays` loaded rays, over the pool; returns how many rays were
// invalid.
template <class Block>
std::size_t for_each_block(const RayColumns& columns, ThreadPool& pool, int max_threads, CancelToken& cancel,
                           Block&& block, std::size_t block_rays = kBlockRays) {
  std::atomic<std::size_t> invalid_count{0};
  const auto trace_task = [&](std::size_t begin, std::size_t end) {
    KeptByThread<AlignedVector<Ray>> kept;
    std::size_t invalid = 0;
    for (std::size_t first = begin; first < end; first += block_rays) {
      const std::span<Ray> rays = room_for(*kept, std::min(block_rays, end - first));
      invalid += load_rays(columns, first, rays);
      block(std::span<const Ray>(rays), first);
    }
    invalid_count.fetch_add(invalid, std::memory_order_relaxed);
  };
  const int threads = max_threads == 0 ? pool.thread_count() : std::min(max_threads, pool.thread_count());
  for_each_task(columns.count, pool, max_threads, cancel, trace_task,
                fair_task_rays(columns.count, block_rays, static_cast<std::size_t>(threads)));
  return invalid_count.load();
}

}  // namespace perfect_bvh
