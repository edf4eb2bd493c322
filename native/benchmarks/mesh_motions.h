// How meshes move in benchmarks of updates.
#pragma once

#include "mesh/mesh.h"

namespace perfect_bvh::bench {

using Positions = AlignedVector<Vec3f>;

[[nodiscard]] Aabb bounds_of_positions(const Positions& positions);

// About the longest axis of the mesh's box, by so much from end to end.
[[nodiscard]] Positions twisted(Positions positions, float radians);

// By a fiftieth of the mesh's length, another way in every frame.
[[nodiscard]] Positions swayed(Positions positions, int frame);

[[nodiscard]] Mesh with(const Mesh& mesh, Positions positions);

}  // namespace perfect_bvh::bench
