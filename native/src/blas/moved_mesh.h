// The trees of a mesh that moves within the shutter: one, refitted to each of its steps. All have the same nodes and
// leaves, one scale and one extent, so that a kernel can be between two of them. They are those of the tree that is
// best half-way: by the ends of an explosion, what was together at its beginning is not.
#pragma once

#include <memory>
#include <span>

#include "blas/blas.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "mesh/round_mesh.h"
#include "stats/statistics.h"

namespace perfect_bvh {

// build_wide_tree() of a mesh that moves: built over where its primitives are half-way, refitted to the first step.
void build_moving_tree(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel);

// `blas` has the tree of the first step; does nothing if its mesh does not move. Throws Cancelled, bad_alloc.
void add_motion_steps(Blas& blas, ThreadPool& pool, CancelToken& cancel);

// Moved balls ---------------------------------------------------------------------------------------------------------
// Curves or points of which only the balls moved, or got other radii.

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

// Moved mesh ----------------------------------------------------------------------------------------------------------
// A mesh of which only the vertices moved: it shares the triangles with the one before, and its positions go where
// those of an older one were. A system takes longer to hand out new memory than a copy takes to fill it.

// A mesh whose positions, or balls, are given to `spare` at the end.
[[nodiscard]] std::shared_ptr<const Mesh> lend_mesh(Mesh mesh, const std::shared_ptr<SparePositions>& spare);

// T: float or double, which is recentred again. Throws InvalidArgument for other counts than the mesh's and for
// positions that are not good; `function` opens the message.
template <class T>
[[nodiscard]] std::shared_ptr<const Mesh> move_vertices(const Mesh& mesh, std::span<const Vec3<T>> positions,
                                                        const std::shared_ptr<SparePositions>& spare, ThreadPool& pool,
                                                        const char* function);

// The same of one that moves within the shutter: positions of all vertices at each of the steps, one step after
// another.
template <class T>
[[nodiscard]] std::shared_ptr<const Mesh> move_in_steps(const Mesh& mesh, std::span<const Vec3<T>> positions,
                                                        const StepTimes& times,
                                                        const std::shared_ptr<SparePositions>& spare, ThreadPool& pool,
                                                        const char* function);

}  // namespace perfect_bvh
