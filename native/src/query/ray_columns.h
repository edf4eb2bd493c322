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
#include "traverse/ray.h"
#include "traverse/ray_reordering.h"
#include "traverse/strategy.h"

namespace perfect_bvh {

// Float or double: exactly one of each pair of pointers is set. Scalars have a stride of 0, arrays of 1.
struct RayColumns {
  std::size_t count = 0;
  const Vec3f* origins_float = nullptr;
  const Vec3d* origins_double = nullptr;
  const Vec3f* directions_float = nullptr;
  const Vec3d* directions_double = nullptr;
  const float* t_min = nullptr;
  const float* t_max = nullptr;
  const std::uint32_t* masks = nullptr;
  std::size_t t_min_stride = 0, t_max_stride = 0, mask_stride = 0;
  Cull cull = Cull::kNone;
  Strategy strategy = Strategy::kAuto;  // of closest-hit and any-hit queries; the others know one
};

[[nodiscard]] inline Ray load_ray(const RayColumns& columns, std::size_t row) {
  Ray ray;
  ray.origin = columns.origins_double ? columns.origins_double[row] : to_double(columns.origins_float[row]);
  ray.direction = columns.directions_double ? columns.directions_double[row] : to_double(columns.directions_float[row]);
  ray.t_min = columns.t_min[row * columns.t_min_stride];
  ray.t_max = columns.t_max[row * columns.t_max_stride];
  ray.mask = columns.masks[row * columns.mask_stride];
  return ray;
}

// Rays a task takes at a time: enough to repay the hand-over, few enough to stop soon and to share out evenly.
inline constexpr std::size_t kTaskRays = 4096;
// Rays loaded at a time: enough to keep many under way to the end, few enough for the second level cache.
inline constexpr std::size_t kBlockRays = 1024;
// Where coherent rays are looked for, large batches are traced as many rays at a time as can be put in order: several
// rows of an image. By the number of rays alone, so that all answers are.
[[nodiscard]] inline std::size_t large_block_rays(std::size_t count) noexcept {
  return std::clamp(count / 16 / kPacketRays * kPacketRays, kBlockRays, kReorderedRays);
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
    AlignedVector<Ray> rays;
    rays.reserve(std::min(block_rays, end - begin));
    std::size_t invalid = 0;
    for (std::size_t first = begin; first < end; first += block_rays) {
      const std::size_t count = std::min(block_rays, end - first);
      rays.clear();
      for (std::size_t i = 0; i < count; ++i) {
        rays.push_back(load_ray(columns, first + i));
        invalid += is_valid(rays.back()) ? 0 : 1;
      }
      block(std::span<const Ray>(rays), first);
    }
    invalid_count.fetch_add(invalid, std::memory_order_relaxed);
  };
  for_each_task(columns.count, pool, max_threads, cancel, trace_task, std::max(kTaskRays, block_rays));
  return invalid_count.load();
}

}  // namespace perfect_bvh
