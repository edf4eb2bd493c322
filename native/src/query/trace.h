// Memory that a thread keeps from block to block and from batch to batch. Rays and hits of a large block take 0.7 MB,
// which the system would otherwise allocate page by page each time.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/vec3.h"
#include "query/hit_columns.h"
#include "stats/statistics.h"
#include "tlas/assemble.h"
#include "traverse/dispatch.h"
#include "traverse/ray.h"
#include "traverse/ray_reordering.h"

namespace perfect_bvh {

// The calling thread's T during the lifetime of this object. Nested code that wants one too (a callback that casts
// rays) gets an empty one.
template <class T>
class KeptByThread {
 public:
  KeptByThread() : value_(std::move(kept())) {}
  ~KeptByThread() { kept() = std::move(value_); }
  KeptByThread(const KeptByThread&) = delete;
  KeptByThread& operator=(const KeptByThread&) = delete;

  [[nodiscard]] T* operator->() noexcept { return &value_; }
  [[nodiscard]] T& operator*() noexcept { return value_; }

 private:
  static T& kept() noexcept {
    thread_local T value;
    return value;
  }
  T value_;
};

// Returns the first `count` elements of a kept array, with undefined values.
template <class T>
[[nodiscard]] std::span<T> room_for(AlignedVector<T>& kept, std::size_t count) {
  if (kept.size() < count) kept.resize(count);
  return {kept.data(), count};
}

// Ray columns ---------------------------------------------------------------------------------------------------------
// The rays of a batch as columns that the caller owns, and the loop over them.

// Vectors are float or double: exactly one of each pair of pointers is set. Strides count numbers. For vectors: 3 for a
// plain array, 0 for one vector that all rays share. For numbers: 1, or 0 for one that all share.
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
  Strategy strategy = Strategy::kAuto;  // of closest-hit and any-hit queries; others have only one strategy
};

// Loads the rays of rows `first` on, one for each of `rays`; returns the number of invalid ones.
std::size_t load_rays(const RayColumns& columns, std::size_t first, std::span<Ray> rays) noexcept;

[[nodiscard]] inline Ray load_ray(const RayColumns& columns, std::size_t row) noexcept {
  Ray ray;
  load_rays(columns, row, {&ray, 1});
  return ray;
}

// Rays per task: enough to outweigh its overhead, few enough to stop soon and to divide evenly.
inline constexpr std::size_t kTaskRays = 4096;
// Rays loaded at a time: enough to keep many in flight to the end, few enough for the second level cache.
inline constexpr std::size_t kBlockRays = 1024;
// Rays per block of large batches, in which coherent rays are searched. A block has enough rays for good packets, that
// is several rows of an image, and leaves room for the tree in the second level cache: a ray and its hit take 84 bytes.
// With 8,192, coherent rays are as fast as with twice as many, and random rays a few percent faster. The size depends
// only on the number of rays, so that all answers do.
inline constexpr std::size_t kLargeBlockRays = 8192;
static_assert(kLargeBlockRays <= kReorderedRays);
[[nodiscard]] inline std::size_t large_block_rays(std::size_t count) noexcept {
  return std::clamp(count / 16 / kPacketRays * kPacketRays, kBlockRays, kLargeBlockRays);
}

// Returns the rays per task of a batch in blocks: whole blocks, and few enough that every thread gets some tasks, even
// of a small batch.
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

// Calls block(rays, first row) for every block of `block_rays` loaded rays, over the pool; returns the number of
// invalid rays.
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

// Ray batch -----------------------------------------------------------------------------------------------------------
// Traces millions of rays at once: arrays in, arrays out, over the thread pool.
// In: columns that the caller owns. Out: the requested columns, always one row per ray.

struct BatchSummary {
  std::size_t invalid_count = 0;  // see is_valid
  std::size_t packet_count = 0;   // rays that were traced in packets
};

// max_threads 0: all of the pool's.
BatchSummary cast_rays(const Snapshot& snapshot, const RayColumns& rays, const HitColumns& hits, ThreadPool& pool,
                       int max_threads, CancelToken& cancel);
// Returns the number of invalid rays.
std::size_t test_occlusions(const Snapshot& snapshot, const RayColumns& rays, std::uint8_t* occluded, ThreadPool& pool,
                            int max_threads, CancelToken& cancel);

// Trace ---------------------------------------------------------------------------------------------------------------
// Traces a batch of rays through a snapshot on the calling thread. Callers divide large batches among threads; the
// answers depend neither on the division nor on the order of the rays.
// In: rays in world space. Out: always one row per ray; invalid rays are misses.

// `counts` is empty, or has a row per ray. Both return the number of rays traced in packets. They check `cancel`
// regularly (see Interruption). Throws Cancelled.
std::size_t trace_closest(const Snapshot& snapshot, CancelToken& cancel, std::span<const Ray> rays, std::span<Hit> hits,
                          Cull cull = Cull::kNone, std::span<RayCounts> counts = {},
                          Strategy strategy = Strategy::kAuto);
// occluded[i] = 1 if anything lies within the ray's range.
std::size_t trace_occluded(const Snapshot& snapshot, CancelToken& cancel, std::span<const Ray> rays,
                           std::span<std::uint8_t> occluded, Cull cull = Cull::kNone, std::span<RayCounts> counts = {},
                           Strategy strategy = Strategy::kAuto);

// The same without cancellation.
inline std::size_t trace_closest(const Snapshot& snapshot, std::span<const Ray> rays, std::span<Hit> hits,
                                 Cull cull = Cull::kNone, std::span<RayCounts> counts = {},
                                 Strategy strategy = Strategy::kAuto) {
  CancelToken never;
  return trace_closest(snapshot, never, rays, hits, cull, counts, strategy);
}
inline std::size_t trace_occluded(const Snapshot& snapshot, std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                                  Cull cull = Cull::kNone, std::span<RayCounts> counts = {},
                                  Strategy strategy = Strategy::kAuto) {
  CancelToken never;
  return trace_occluded(snapshot, never, rays, occluded, cull, counts, strategy);
}

// A triangle's corners in world space, in winding order.
struct WorldTriangle {
  Vec3d v0, v1, v2;

  // Follows the world winding (it is not turned towards the ray); its length is twice the area.
  [[nodiscard]] Vec3d scaled_normal() const noexcept { return cross(v1 - v0, v2 - v0); }
  // Returns the point with the hit's u and v.
  [[nodiscard]] Vec3d at(const Hit& hit) const noexcept {
    const auto u = static_cast<double>(hit.u), v = static_cast<double>(hit.v);
    return v0 * (1.0 - u - v) + v1 * u + v2 * v;
  }
};
// time: for an instance that moves within the shutter.
[[nodiscard]] WorldTriangle place_moving_triangle(const Instance& instance, TriangleIndices corners,
                                                  float time) noexcept;
[[nodiscard]] inline WorldTriangle place_triangle(const Instance& instance, TriangleIndices corners,
                                                  float time = 0.0f) noexcept {
  if (instance.motion != 0) return place_moving_triangle(instance, corners, time);
  const auto place = [&](std::uint32_t vertex) {
    return instance.object_to_world.point(to_double(instance.blas->mesh.positions[vertex]));
  };
  return {place(corners.x), place(corners.y), place(corners.z)};
}
[[nodiscard]] WorldTriangle world_triangle(const Snapshot& snapshot, const Hit& hit, float time = 0.0f) noexcept;
// Returns the point on the triangle, from u and v.
[[nodiscard]] Vec3d hit_position(const Snapshot& snapshot, const Hit& hit, float time = 0.0f) noexcept;
// Returns where the ray hits the triangle's plane, in double: on a plane of kilometres, u and v, which are floats, are
// off by millimetres. Uses u and v if the plane is less exact: for triangles that are seen edge-on, or some million
// times as long as wide, or as far away as they are long.
[[nodiscard]] Vec3d ray_position(const Instance& instance, TriangleIndices corners, const Hit& hit,
                                 const Ray& ray) noexcept;

// Intersections -------------------------------------------------------------------------------------------------------
// Finds all hits of each ray of a batch, or counts them.
// A triangle is reported once per ray, even if it is in several leaves. Rows of a ray are sorted by t, then (order, id,
// primitive): the first is the answer of cast_rays().

// Writes one count per ray. Returns the number of invalid rays (see is_valid). max_threads 0: all of the pool's.
std::size_t count_intersections(const Snapshot& snapshot, const RayColumns& rays, std::int32_t* counts,
                                ThreadPool& pool, int max_threads, CancelToken& cancel);

// Writes ray i's hits to rows splits[i] to splits[i + 1]. If there is no room for all, writes the nearest; there must
// not be more room than hits. Returns as above.
std::size_t list_intersections(const Snapshot& snapshot, const RayColumns& rays, std::span<const std::int64_t> splits,
                               const HitColumns& hits, ThreadPool& pool, int max_threads, CancelToken& cancel);

}  // namespace perfect_bvh
