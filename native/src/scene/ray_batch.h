// Millions of rays at once: arrays in, arrays out, over the thread pool.
// In: columns that the caller owns. Out: the columns that were asked for, one row a ray, always.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "scene/snapshot.h"
#include "traverse/ray.h"

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
};

// Null: not wanted. Misses: t and distances infinite, ids -1, everything else zero.
struct HitColumns {
  float* t = nullptr;
  std::int32_t* instance_ids = nullptr;
  std::int32_t* mesh_ids = nullptr;
  std::int32_t* primitive_ids = nullptr;
  float* uvs = nullptr;         // 2 a ray
  float* normals = nullptr;     // 3 a ray, world space, unit length, by winding
  double* positions = nullptr;  // 3 a ray, world space
  double* distances = nullptr;  // world units
  std::uint8_t* front_face = nullptr;
  std::int32_t* nodes_visited = nullptr;
  std::int32_t* primitives_tested = nullptr;
};

// Both return how many rays were invalid (see is_valid). max_threads 0: all of the pool's.
std::size_t cast_rays(const Snapshot& snapshot, const RayColumns& rays, const HitColumns& hits, ThreadPool& pool,
                      int max_threads, CancelToken& cancel);
std::size_t test_occlusions(const Snapshot& snapshot, const RayColumns& rays, std::uint8_t* occluded, ThreadPool& pool,
                            int max_threads, CancelToken& cancel);

}  // namespace perfect_bvh
