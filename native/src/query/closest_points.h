// The nearest point of a scene to each of many points: columns in, columns out, over the thread pool.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// Scalars have a stride of 0, arrays of 1.
struct PointColumns {
  std::size_t count = 0;
  const Vec3d* points = nullptr;
  const double* max_distances = nullptr;
  const std::uint32_t* masks = nullptr;
  std::size_t max_distance_stride = 0, mask_stride = 0;
  const float* times = &kShutterOpens;  // within the shutter, 0 to 1
  std::size_t time_stride = 0;
};

// One row a point. Nothing found: distances infinite, ids -1, everything else zero.
struct ClosestColumns {
  double* points = nullptr;     // 3 a point, world space
  double* distances = nullptr;  // world units
  std::int32_t* instance_ids = nullptr;
  std::int32_t* mesh_ids = nullptr;
  std::int32_t* primitive_ids = nullptr;
  float* uvs = nullptr;  // 2 a point; of a curve's segment u is along it, v 0
};

// Curves and points are solid: inside of one the distance is 0, and the nearest point is the point itself.
// Of several primitives at exactly the same distance the smallest (order, id, primitive) is found. Returns how many
// points were invalid: not finite, with a distance that is negative or NaN, or with no time of the shutter. max_threads
// 0: all of the pool's.
std::size_t compute_closest_points(const Snapshot& snapshot, const PointColumns& points, const ClosestColumns& closest,
                                   ThreadPool& pool, int max_threads, CancelToken& cancel);

}  // namespace perfect_bvh
