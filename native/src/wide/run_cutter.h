// Cuts triangles that follow each other along a Morton curve into runs that fit into a leaf each. A run is the
// largest subtree of the codes' radix tree that starts where the last one ended and fits.
// In: a chunk of the order. Out: the runs' lengths, and what filling the blocks needs to know of the corners.
#pragma once

#include <cstdint>
#include <vector>

#include "builders/build_config.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "mesh/triangle_mesh.h"
#include "wide/triangle_order.h"

namespace perfect_bvh {

inline constexpr std::size_t kRunChunk = 1024;  // triangles cut together; no run spans two chunks
inline constexpr std::uint32_t kLeafSize = 8;   // triangles that a leaf holds, and vertices that a block does
inline constexpr std::uint32_t kMostBack = 3 * kLeafSize;  // corners; what lies farther back is in no run together

struct RunChunk {
  std::vector<std::uint8_t> sizes;
  // Only where a leaf holds its vertices (default layout):
  AlignedVector<std::uint32_t> corners;  // three vertices for each triangle
  AlignedVector<std::uint8_t> way_back;  // how many corners ago its vertex occurred last, at most kMostBack
};

// One for each thread: it remembers where in the order a vertex occurred last.
class RunCutter {
 public:
  RunCutter(const TriangleMesh& mesh, const TriangleOrder& order, TreeLayout layout, CancelToken& cancel);

  // Triangles in places [begin, end) of the order, at most kRunChunk of them.
  void cut(std::size_t begin, std::size_t end, RunChunk& chunk);

 private:
  void match_corners(std::size_t begin, std::size_t end, RunChunk& chunk);
  void choose_runs(std::size_t begin, std::size_t end, RunChunk& chunk) const;

  const TriangleMesh& mesh_;
  const TriangleOrder& order_;
  const bool limits_vertices_;
  AlignedVector<std::uint32_t> last_corner_;  // by vertex: 3 * place + corner
  AlignedVector<std::uint32_t> newness_;      // by triangle of the chunk: see kNewness; 0 where vertices do not count
};

}  // namespace perfect_bvh
