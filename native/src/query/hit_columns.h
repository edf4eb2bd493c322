// The hits of a batch as columns that the caller owns.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stats/statistics.h"
#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// Columns that are null are not requested. Misses: t and distances infinite, ids -1, everything else zero.
struct HitColumns {
  float* t = nullptr;
  std::int32_t* instance_ids = nullptr;
  std::int32_t* mesh_ids = nullptr;
  std::int32_t* primitive_ids = nullptr;  // for curves and points, the caller's numbers
  float* uvs = nullptr;                   // 2 a ray; of curves u along the whole curve and 0, of points zeros
  float* normals = nullptr;               // 3 a ray, world space, unit length, by winding; of curves and points outward
  double* positions = nullptr;            // 3 per ray, world space, see ray_position and round_surface.h
  double* distances = nullptr;            // world units
  std::uint8_t* front_face = nullptr;
  std::int32_t* nodes_visited = nullptr;
  std::int32_t* primitives_tested = nullptr;

  [[nodiscard]] bool want_counts() const noexcept { return nodes_visited || primitives_tested; }
};

// Writes the rows from `first` on of every requested column, except the counts of a ray's cost. Works column by column,
// so that columns not requested cost nothing. One ray for each hit.
void store_hits(const HitColumns& out, std::size_t first, const Snapshot& snapshot, std::span<const Hit> hits,
                std::span<const Ray> rays);
// Writes the columns of counts.
void store_counts(const HitColumns& out, std::size_t first, std::span<const RayCounts> counts);

}  // namespace perfect_bvh
