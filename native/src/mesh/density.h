// How much of a mesh's box its triangles' boxes fill: what the cost of a tree over them grows with as the mesh bends.
// In: a mesh. Out: the area of the triangles' boxes over that of the mesh's, from every so-many-th triangle.
#pragma once

#include "mesh/triangle_mesh.h"

namespace perfect_bvh {

// 0 for a mesh whose box has no area. Looks at some thousand triangles and at every vertex.
[[nodiscard]] double measure_density(const TriangleMesh& mesh) noexcept;

}  // namespace perfect_bvh
