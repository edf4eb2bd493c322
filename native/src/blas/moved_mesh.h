// The trees of a mesh that moves within the shutter: one tree, refitted to each of its steps. All have the same nodes
// and leaves, one scale and one extent, so that a kernel can interpolate between two of them. Their structure is that
// of the best tree for the mesh half-way. In an explosion, for example, triangles that are close at the beginning are
// far apart at the end.
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

// Does build_wide_tree() for a mesh that moves: builds the tree over the half-way positions, and refits it to the first
// step.
void build_moving_tree(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel);

// Adds the trees of the later steps. `blas` has the tree of the first step. Does nothing if its mesh does not move.
// Throws Cancelled, bad_alloc.
void add_motion_steps(Blas& blas, ThreadPool& pool, CancelToken& cancel);

// Moved spheres -------------------------------------------------------------------------------------------------------
// Curves or points of which only the spheres changed their position or radius.

struct MovedBalls {
  std::shared_ptr<const Mesh> mesh;
  bool same_primitives;
};

// Moves spheres. If no radii are given, the radii stay. If spheres gain or lose a radius, the primitives may differ
// from before: the mesh is then made again, and `same_primitives` is false. Throws InvalidArgument if the number of
// spheres differs, and for input that make_points() would reject; `function` opens the message. T: float or double;
// double input is recentred.
template <class T>
[[nodiscard]] MovedBalls move_balls(const Mesh& mesh, const BallsGiven<T>& balls,
                                    const std::shared_ptr<SparePositions>& spare, ThreadPool& pool,
                                    const char* function);

// Returns the mesh at another step of its motion within the shutter: the same primitives, in the same frame. Throws
// InvalidArgument as move_balls() does, and if a sphere has a radius at only one of the steps.
template <class T>
[[nodiscard]] std::shared_ptr<const Mesh> balls_at_step(const Mesh& first, const BallsGiven<T>& balls, ThreadPool& pool,
                                                        const char* function);

// Moved mesh ----------------------------------------------------------------------------------------------------------
// A mesh of which only the vertices moved. It shares the triangles with the previous mesh, and reuses the memory of
// older positions: a system takes longer to allocate new memory than a copy takes to fill it.

// Returns a mesh whose positions, or spheres, are returned to `spare` in the end.
[[nodiscard]] std::shared_ptr<const Mesh> lend_mesh(Mesh mesh, const std::shared_ptr<SparePositions>& spare);

// T: float or double; double input is recentred. Throws InvalidArgument for a number of positions other than the mesh's
// and for invalid positions; `function` opens the message.
template <class T>
[[nodiscard]] std::shared_ptr<const Mesh> move_vertices(const Mesh& mesh, std::span<const Vec3<T>> positions,
                                                        const std::shared_ptr<SparePositions>& spare, ThreadPool& pool,
                                                        const char* function);

// The same for a mesh that moves within the shutter: the positions of all vertices at each step, one step after
// another.
template <class T>
[[nodiscard]] std::shared_ptr<const Mesh> move_in_steps(const Mesh& mesh, std::span<const Vec3<T>> positions,
                                                        const StepTimes& times,
                                                        const std::shared_ptr<SparePositions>& spare, ThreadPool& pool,
                                                        const char* function);

}  // namespace perfect_bvh
