// The hits of a batch as columns that the caller owns.
#pragma once

#include <cstddef>
#include <cstdint>

#include "tlas/snapshot.h"
#include "traverse/ray.h"

namespace perfect_bvh {

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

// Writes one row of every column that is wanted, but for the counts of what a ray cost.
void store_hit(const HitColumns& out, std::size_t row, const Snapshot& snapshot, const Hit& hit, const Ray& ray);

}  // namespace perfect_bvh
