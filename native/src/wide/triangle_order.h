// A mesh's triangles in the order of the Morton codes of their boxes' centres.
#pragma once

#include <cstdint>
#include <span>

#include "core/cancel.h"
#include "core/scratch.h"
#include "core/thread_pool.h"
#include "math/float4.h"
#include "mesh/mesh.h"

namespace perfect_bvh {

struct TriangleOrder {
  std::span<const std::uint64_t> sorted;  // a code in the upper half of each, a triangle's number in the lower
  Box4 bounds;                            // of the triangles: vertices that none uses do not count

  [[nodiscard]] std::uint32_t triangle(std::size_t place) const noexcept {
    return static_cast<std::uint32_t>(sorted[place]);
  }
  [[nodiscard]] std::uint32_t code(std::size_t place) const noexcept {
    return static_cast<std::uint32_t>(sorted[place] >> 32);
  }
};

// What it takes of `scratch`.
[[nodiscard]] inline std::size_t order_byte_count(std::size_t triangle_count) noexcept {
  return 2 * triangle_count * sizeof(std::uint64_t);
}

// In `scratch`. The same for any number of threads.
[[nodiscard]] TriangleOrder order_triangles(const Mesh& mesh, Scratch& scratch, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
