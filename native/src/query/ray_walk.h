// Records the path of one ray through the trees, event by event, to display it or to evaluate a tree.
// In: a snapshot and a ray. Out: the boxes and triangles that the ray tests, in the kernels' order. The walk uses the
// kernels' tests, so it ends at the same hit after the same number of nodes and triangles.
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
  kEnterInstance,     // continues in the tree of an instance, with the ray transformed
  kSkipInstance,      // reaches an instance that it does not see, or misses
  kBoxHit,            // tested: will be visited, unless a hit is found before
  kBoxMissed,         // tested: the ray misses it
  kBoxPruned,         // tested: it begins behind the nearest hit yet
  kWaitingPruned,     // was waiting for its visit, but begins behind a hit found since
  kTriangleMissed,    // tested
  kTriangleHit,       // tested: the nearest hit yet
  kTriangleRejected,  // tested: hit behind the nearest hit, out of the ray's range or on the culled side
};

// Columns of equal length.
struct RayWalk {
  std::vector<WalkEvent> events;
  std::vector<double> bounds;      // six per event: lower x, y, z, upper x, y, z, in the space of the box's tree
  std::vector<double> transforms;  // twelve per event: rows of the map from there to the world
  // Nine per event: corners in the world; for a curve's segment or a point, its centres. NaN for other events.
  std::vector<double> triangles;
  std::vector<double> t;                   // where the ray enters the box or hits the triangle; infinite if it does not
  std::vector<double> nearest_t;           // of the nearest hit after the event; infinite before the first
  std::vector<std::int32_t> levels;        // of the box in its tree, 0 for the root; a triangle has that of its leaf
  std::vector<std::int32_t> instance_ids;  // of the tree, or of the instance entered; -1 for boxes of the top level
  std::vector<std::int32_t> mesh_ids;      // the same
  std::vector<std::int32_t> primitive_ids;  // -1 for events without a triangle
  [[nodiscard]] std::size_t count() const noexcept { return events.size(); }
};

// Returns no events for an invalid ray. Builds the trees that the ray reaches and that are not built yet. Throws
// Cancelled, bad_alloc, and the exceptions of building.
[[nodiscard]] RayWalk walk_ray(const Snapshot& snapshot, const Ray& ray, Cull cull, CancelToken& cancel);

}  // namespace perfect_bvh
