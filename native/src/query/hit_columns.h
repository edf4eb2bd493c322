// The hits of a batch as columns that the caller owns.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stats/statistics.h"
#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// Null: not wanted. Misses: t and distances infinite, ids -1, everything else zero.
struct HitColumns {
  float* t = nullptr;
  std::int32_t* instance_ids = nullptr;
  std::int32_t* mesh_ids = nullptr;
  std::int32_t* primitive_ids = nullptr;  // of curves and points by the caller's numbers
  float* uvs = nullptr;                   // 2 a ray; of curves u along the whole curve and 0, of points zeros
  float* normals = nullptr;               // 3 a ray, world space, unit length, by winding; of curves and points outward
  double* positions = nullptr;            // 3 a ray, world space, see ray_position and round_surface.h
  double* distances = nullptr;            // world units
  std::uint8_t* front_face = nullptr;
  std::int32_t* nodes_visited = nullptr;
  std::int32_t* primitives_tested = nullptr;

  [[nodiscard]] bool want_counts() const noexcept { return nodes_visited || primitives_tested; }
};

// Writes the rows from `first` on of every column that is wanted, but for the counts of what a ray cost: column by
// column, so that what is not wanted costs nothing. One ray for each hit.
void store_hits(const HitColumns& out, std::size_t first, const Snapshot& snapshot, std::span<const Hit> hits,
                std::span<const Ray> rays);
// The rest.
void store_counts(const HitColumns& out, std::size_t first, std::span<const RayCounts> counts);

}  // namespace perfect_bvh
