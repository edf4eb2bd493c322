// How meshes move in benchmarks of updates.
#pragma once

#include "mesh/mesh.h"

namespace perfect_bvh::bench {

using Positions = AlignedVector<Vec3f>;

[[nodiscard]] Aabb bounds_of_positions(const Positions& positions);

// Twists the mesh about the longest axis of its box; `radians` is the angle from end to end.
[[nodiscard]] Positions twisted(Positions positions, float radians);

// Sways the mesh by a fiftieth of its length, in another direction in every frame.
[[nodiscard]] Positions swayed(Positions positions, int frame);

[[nodiscard]] Mesh with(const Mesh& mesh, Positions positions);

}  // namespace perfect_bvh::bench
