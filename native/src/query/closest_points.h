// Finds the nearest point of a scene to each of many points: columns in, columns out, on the thread pool.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// The stride of a column is 0 for a scalar and 1 for an array.
struct PointColumns {
  std::size_t count = 0;
  const Vec3d* points = nullptr;
  const double* max_distances = nullptr;
  const std::uint32_t* masks = nullptr;
  std::size_t max_distance_stride = 0, mask_stride = 0;
  const float* times = &kShutterOpens;  // within the shutter, 0 to 1
  std::size_t time_stride = 0;
};

// One row per point. If nothing is found: distances infinite, ids -1, everything else zero.
struct ClosestColumns {
  double* points = nullptr;     // 3 per point, world space
  double* distances = nullptr;  // world units
  std::int32_t* instance_ids = nullptr;
  std::int32_t* mesh_ids = nullptr;
  std::int32_t* primitive_ids = nullptr;
  float* uvs = nullptr;  // 2 per point; for a curve's segment u is along it, v is 0
};

// Curves and points are solid: for a point inside, the distance is 0, and the nearest point is the point itself. Among
// primitives at exactly the same distance, the smallest (order, id, primitive) is found. Returns the number of invalid
// points: not finite, with a negative or NaN distance, or with a time outside the shutter. max_threads 0: all of the
// pool's.
std::size_t compute_closest_points(const Snapshot& snapshot, const PointColumns& points, const ClosestColumns& closest,
                                   ThreadPool& pool, int max_threads, CancelToken& cancel);

}  // namespace perfect_bvh
