// The quality of a tree: the surface area heuristic and other figures for readers.
// Sources: MacDonald and Booth 1990 (SAH); Aila, Karras and Laine 2013, "On quality metrics of bounding volume
// hierarchies" (leaf-count variability and end-point overlap, see quality.cpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/vec3.h"

namespace perfect_bvh {

struct TreeQuality {
  // The expected visits and tests of a random ray that hits the root's box: sums of areas over the root's area.
  double node_visits = 0;
  double primitive_tests = 0;
  double sah = 0;  // the sum of the two
  std::size_t node_count = 0;
  std::size_t leaf_count = 0;
  std::size_t reference_count = 0;  // primitives in leaves, counting repetitions ...
  std::size_t primitive_count = 0;  // ... and without repetitions: fewer only after spatial splits
  double sibling_overlap = 0;       // area that both children cover, as a share of their parents' area
  std::uint32_t depth = 0;
  std::uint32_t max_leaf_size = 0;
  bool is_refittable = true;
};

[[nodiscard]] TreeQuality measure_quality(const Bvh2& tree, CancelToken& cancel);
[[nodiscard]] inline TreeQuality measure_quality(const Bvh2& tree) {
  CancelToken never;
  return measure_quality(tree, never);
}

// Measures leaf-count variability: the standard deviation of the number of leaf boxes that a random line through the
// root's box hits. The number does not depend on the number of threads.
[[nodiscard]] double measure_leaf_count_variability(const Bvh2& tree, std::uint32_t line_count, ThreadPool& pool,
                                                    CancelToken& cancel);

// Measures end-point overlap: the sum over nodes, 1 for an interior one and 1 for each of a leaf's triangles, times
// (area of the triangles inside the node's box that are not below the node), divided by the area of all triangles; 0 if
// they have none. The number does not depend on the number of threads. Takes about a microsecond for each node that a
// triangle overlaps: use it for display, not for decisions. Counts triangles.size() units of work on `cancel`.
[[nodiscard]] double measure_epo(const Bvh2& tree, std::span<const Vec3f> positions,
                                 std::span<const Vec3<std::uint32_t>> triangles, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
