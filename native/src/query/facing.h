// Which side of a triangle a ray met, as the kernels decide it when they cull.
#pragma once

#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// True if the corners run counter-clockwise in world space as seen from the ray's origin. In the mesh's space, where
// kernels decide it exactly (math/triangle.h): of a ray that hits the triangle it is what culling goes by.
[[nodiscard]] bool shows_front(const Snapshot& snapshot, const Hit& hit, TriangleIndices corners,
                               const Ray& ray) noexcept;

}  // namespace perfect_bvh
