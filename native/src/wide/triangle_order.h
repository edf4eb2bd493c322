// A mesh's triangles in the order of the Morton codes of their boxes' centres.
#pragma once

#include <cstdint>

#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/float4.h"
#include "mesh/triangle_mesh.h"

namespace perfect_bvh {

struct TriangleOrder {
  AlignedVector<Float4> vertices;       // the mesh's, a register each; the fourth lane is 0
  AlignedVector<std::uint64_t> sorted;  // a code in the upper half of each, a triangle's number in the lower
  Box4 bounds;                          // of the triangles: vertices that none uses do not count

  [[nodiscard]] std::uint32_t triangle(std::size_t place) const noexcept {
    return static_cast<std::uint32_t>(sorted[place]);
  }
  [[nodiscard]] std::uint32_t code(std::size_t place) const noexcept {
    return static_cast<std::uint32_t>(sorted[place] >> 32);
  }
};

// The same for any number of threads.
[[nodiscard]] TriangleOrder order_triangles(const TriangleMesh& mesh, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
