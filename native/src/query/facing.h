// Finds the side of a triangle that a ray hit, by the rule that the kernels cull by.
#pragma once

#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// Returns true if the corners run counter-clockwise in world space as seen from the ray's origin. Decided exactly in
// the mesh's space, like the kernels' culling (math/triangle.h); the ray must hit the triangle.
[[nodiscard]] bool shows_front(const Snapshot& snapshot, const Hit& hit, TriangleIndices corners,
                               const Ray& ray) noexcept;

}  // namespace perfect_bvh
