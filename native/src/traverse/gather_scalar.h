// Reads a leaf of the compact layout, in plain C++.
// Included by one translation unit only; everything in it has internal linkage.
#pragma once

#include "traverse/gathered_leaf.h"
#include "traverse/scene_view.h"

namespace perfect_bvh {
namespace {

inline void gather_leaf(GatheredLeaf& leaf, const IndexedLeaves& from, std::uint32_t row) noexcept {
  for (int lane = 0; lane < 8; ++lane) {
    leaf.primitives[lane] = from.rows[row].primitives[lane];
    const Vec3<std::uint32_t>& triangle = from.triangles[leaf.primitives[lane]];
    const std::uint32_t vertices[3] = {triangle.x, triangle.y, triangle.z};
    for (int corner = 0; corner < 3; ++corner) {
      const Vec3f& position = from.positions[vertices[corner]];
      leaf.corners[corner][0][lane] = position.x * from.scale;
      leaf.corners[corner][1][lane] = position.y * from.scale;
      leaf.corners[corner][2][lane] = position.z * from.scale;
    }
  }
}

// `ball(lane)` is the ball of that lane.
template <class BallOf>
inline void gather_balls(float (*rows)[8], float scale, const BallOf& ball) noexcept {
  for (int lane = 0; lane < 8; ++lane) {
    const Ball& from = ball(lane);
    rows[0][lane] = from.centre.x * scale, rows[1][lane] = from.centre.y * scale;
    rows[2][lane] = from.centre.z * scale, rows[3][lane] = from.radius * scale;
  }
}

}  // namespace
}  // namespace perfect_bvh
