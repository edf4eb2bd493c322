// What one ray does on its way through the trees, event by event: to be shown, or to judge a tree by.
// In: a snapshot and a ray. Out: the boxes and triangles that the ray looks at, in the order in which kernels do, which
// the walk shares its tests with: so it ends at the same hit, after as many nodes and triangles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/cancel.h"
#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// The numbers are those of Python's WalkEvent.
enum class WalkEvent : std::uint8_t {
  kEnterNode,         // visits a node, whose children's boxes are tested next
  kEnterLeaf,         // visits a leaf, whose triangles are tested next
  kEnterInstance,     // goes on in the tree of an instance, with the ray transformed
  kSkipInstance,      // reaches an instance that it does not see, or passes by
  kBoxHit,            // tested: will be visited, unless a hit is found before its turn
  kBoxMissed,         // tested: the ray passes by
  kBoxPruned,         // tested: it begins behind the nearest hit so far
  kWaitingPruned,     // was to be visited, and begins behind the hit that was found meanwhile
  kTriangleMissed,    // tested
  kTriangleHit,       // tested: the nearest hit so far
  kTriangleRejected,  // tested: met behind the nearest hit, out of the ray's range or from the side that is culled
};

// Columns of equal length.
struct RayWalk {
  std::vector<WalkEvent> events;
  std::vector<double> bounds;      // six an event: lower x, y, z, upper x, y, z, in the space of the box's tree
  std::vector<double> transforms;  // twelve: rows of the map from there to the world
  // Nine: corners in the world; of a curve's segment or a point its centres. NaN unless the event is a triangle's.
  std::vector<double> triangles;
  std::vector<double> t;             // where the ray enters the box or meets the triangle; infinite where it does not
  std::vector<double> nearest_t;     // the nearest hit's after the event; infinite before the first
  std::vector<std::int32_t> levels;  // of the box in its tree, 0 for the root; a triangle has its leaf's
  std::vector<std::int32_t> instance_ids;   // whose tree it is, or that is entered; -1 for boxes of the top level
  std::vector<std::int32_t> mesh_ids;       // the same
  std::vector<std::int32_t> primitive_ids;  // -1 unless the event is a triangle's
  [[nodiscard]] std::size_t count() const noexcept { return events.size(); }
};

// Nothing happens to an invalid ray. Trees that are not built yet and that the ray reaches are built. Throws Cancelled,
// bad_alloc, and what building throws.
[[nodiscard]] RayWalk walk_ray(const Snapshot& snapshot, const Ray& ray, Cull cull, CancelToken& cancel);

}  // namespace perfect_bvh
