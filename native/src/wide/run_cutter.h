// Cuts triangles, sorted along a Morton curve, into runs that each fit into a leaf. Runs are as long as possible within
// small subtrees of the codes' radix tree.
// In: a chunk of the order. Out: the lengths of the runs, and data on the corners for filling the blocks.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "builders/builder.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/float4.h"
#include "mesh/mesh.h"

namespace perfect_bvh {

// A mesh's triangles in the order of the Morton codes of their boxes' centres.

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

// Returns the bytes that order_triangles() takes from `scratch`.
[[nodiscard]] inline std::size_t order_byte_count(std::size_t triangle_count) noexcept {
  return 2 * triangle_count * sizeof(std::uint64_t);
}

// Sorts the triangles, in `scratch`. The same order for any number of threads.
[[nodiscard]] TriangleOrder order_triangles(const Mesh& mesh, Scratch& scratch, ThreadPool& pool, CancelToken& cancel);

// Runs
// -----------------------------------------------------------------------------------------------------------------

inline constexpr std::size_t kRunChunk = 1024;  // triangles cut together; no run spans two chunks
inline constexpr std::uint32_t kLeafSize = 8;   // triangles that a leaf holds, and vertices that a block does
inline constexpr std::uint32_t kMostBack = 3 * kLeafSize;       // corners; those farther back are never in the same run
inline constexpr std::uint32_t kLongAgo = ~0u - 2 * kMostBack;  // as a corner's number: far before corner 0
// For leaves that hold vertices: all corners are numbered below kLongAgo.
inline constexpr std::size_t kMostCutTriangles = kLongAgo / 3;
inline constexpr std::size_t kCornersAhead = 48;  // corners whose vertices are prefetched

// The runs of all triangles, in the order of the curve.
struct Runs {
  std::span<std::uint8_t> sizes;    // each chunk's begin at its first triangle; `counts` has their number
  std::span<std::uint32_t> counts;  // by chunk
  // Only for triangles, whose leaves hold their vertices:
  std::span<std::uint32_t> corners;  // three vertices for each triangle, then kCornersAhead arbitrary ones
  std::span<std::uint8_t> way_back;  // how many corners ago its vertex occurred last, at most kMostBack
};

[[nodiscard]] Runs make_room_for_runs(const Mesh& mesh, Scratch& scratch);

// One for each thread. It remembers the position in the order where each vertex occurred last.
class RunCutter {
 public:
  // last_corners: for triangles, one entry for every vertex, not shared with other cutters; else empty.
  RunCutter(const Mesh& mesh, const TriangleOrder& order, std::span<std::uint32_t> last_corners, Runs& runs,
            CancelToken& cancel);

  // Cuts the triangles at positions [begin, end) of the order, which are one chunk.
  void cut(std::size_t begin, std::size_t end) noexcept;

 private:
  void match_corners(std::size_t begin, std::size_t end) noexcept;
  void choose_runs(std::size_t begin, std::size_t end) noexcept;

  const Mesh& mesh_;
  const TriangleOrder& order_;
  std::span<std::uint32_t> last_corners_;  // by vertex: 3 * place + corner
  Runs& runs_;
  // By triangle of the chunk: see kNewness. 0 if vertices do not count.
  std::array<std::uint32_t, kRunChunk> newness_{};
};

}  // namespace perfect_bvh
