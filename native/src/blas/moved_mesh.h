// A mesh of which only the vertices moved: it shares the triangles with the one before, and its positions go where
// those of an older one were. A system takes longer to hand out new memory than a copy takes to fill it.
#pragma once

#include <memory>
#include <span>

#include "blas/spare_memory.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"

namespace perfect_bvh {

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
