// Curves or points of which only the balls moved, or got other radii.
#pragma once

#include <memory>

#include "blas/spare_memory.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "mesh/round_mesh.h"

namespace perfect_bvh {

struct MovedBalls {
  std::shared_ptr<const Mesh> mesh;
  bool same_primitives;
};

// No radii: those that they have. Where balls gain a radius or lose it there may be other primitives than before: then
// the mesh is made anew, and `same_primitives` false. Throws InvalidArgument for as many balls as there are not, and
// for what make_points() would not take; `function` opens the message. T: float or double, which is recentred again.
template <class T>
[[nodiscard]] MovedBalls move_balls(const Mesh& mesh, const BallsGiven<T>& balls,
                                    const std::shared_ptr<SparePositions>& spare, ThreadPool& pool,
                                    const char* function);

// The mesh at another step of its motion within the shutter: the same primitives, in the same frame. Throws
// InvalidArgument as move_balls() does, and where a ball has a radius at one step and none at the other.
template <class T>
[[nodiscard]] std::shared_ptr<const Mesh> balls_at_step(const Mesh& first, const BallsGiven<T>& balls, ThreadPool& pool,
                                                        const char* function);

}  // namespace perfect_bvh
