// What a leaf of the wide tree may hold.
#pragma once

#include <cstdint>
#include <span>

#include "builders/build_config.h"
#include "mesh/triangle_mesh.h"
#include "wide/small_set.h"

namespace perfect_bvh {

// Whether different triangles fit into one leaf: at most 8 of them; in the default layout over at most 8 vertices.
[[nodiscard]] inline bool fit_one_leaf(std::span<const std::uint32_t> numbers, const TriangleIndices* triangles,
                                       TreeLayout layout) noexcept {
  if (numbers.size() <= 2) return true;  // they have 6 corners
  if (numbers.size() > SmallSet::kMost) return false;
  if (layout == TreeLayout::kCompact) return true;
  SmallSet vertices;
  for (const std::uint32_t number : numbers) {
    const TriangleIndices corners = triangles[number];
    vertices.add(corners.x, corners.y, corners.z);
  }
  return !vertices.overflows();
}

}  // namespace perfect_bvh
