// The views of a scene that kernels read, including its motion within the shutter: plain structs.
#pragma once

#include <cstddef>
#include <cstdint>

#include "math/curve_joint.h"
#include "math/slab.h"
#include "math/turning.h"
#include "math/vec3.h"
#include "stats/statistics.h"
#include "traverse/ray.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

struct RoundLeaves;

// The leaves of a tree, by its mesh's kind.
union LeafView {
  const LeafBlock* blocks;          // of triangles
  const RoundLeaves* round_leaves;  // of curves and points
};

// A tree at one step. All steps of a tree have the same nodes and leaves, with the boxes and vertices of their time.
struct TreeStep {
  const WideNode* nodes;
  LeafView leaves;
};

// The motion of an instance, of its mesh, or both. Rays read one cache line of it.
struct alignas(64) MotionView {
  const TreeStep* trees = nullptr;  // null: the mesh does not deform
  const TurnBack* backs = nullptr;  // null: the instance does not move
  StepTimes tree_times, turn_times;
  double centre[3] = {0, 0, 0};     // origin of the tree's frame in the mesh's frame, which is the one that turns
  const TurnStep* turns = nullptr;  // null with `backs`
};
static_assert(offsetof(MotionView, turns) == 64);

// Scene view ----------------------------------------------------------------------------------------------------------
// The kernels' view of a scene, of rays and of hits: plain structs, so that including them emits no code.

// The leaves of a tree over curves or points, and the list of the primitives that they name: in the mesh, in its own
// scale.
struct RoundLeaves {
  const PointLeaf* points = nullptr;
  const CurveLeaf* curves = nullptr;  // used instead of points, if not null
  RoundList round;

  // Returns the eight entries of a leaf.
  [[nodiscard]] const std::uint32_t* primitives(std::uint32_t row) const noexcept {
    return curves != nullptr ? curves[row].primitives : points[row].primitives;
  }
};

struct alignas(64) InstanceView {
  // Columns x, y, z, translation, from the scene's scale to the tree's; the fourth row is 0.
  alignas(32) double world_to_local[4][4];
  const WideNode* nodes;
  LeafView leaves;
  TreeExtent extent;
  std::uint32_t root;
  std::uint32_t mask;  // 0 for an instance of an empty mesh
  std::uint16_t mirrored;
  std::uint16_t is_round;  // it is over curves or points
  std::int32_t id;
  std::int64_t order;
  float scale;           // of the tree as stored
  std::uint32_t motion;  // a row among the scene's motions, plus one; 0: it does not move within the shutter
};
static_assert(sizeof(InstanceView) == 192);  // every ray that enters an instance reads all of it

// If rays may visit more bytes than this, the next nodes and leaves are prefetched. Measured with diffuse rays and a
// second level cache of 2 MB: with 27 MB they are 1.4 times as fast, with 7.7 MB 1.3, 4.1 MB 1.2, 2.8 MB 1.1.
inline constexpr std::size_t kCachedBytes = std::size_t{2} << 20;

// Asks whether kernels should stop. It is called at least every kStepsBetweenAsking steps; a step is at most
// kMostRaysInFlight leaves or instances. After a stop, the answers of the batch are undefined. `should_stop` may call
// back into the caller's code, which may trace other batches on this thread.
struct Interruption {
  bool (*should_stop)(void* context) noexcept = nullptr;
  void* context = nullptr;
};
inline constexpr std::uint32_t kStepsBetweenAsking = 1024;

struct SceneView {
  const WideNode* nodes = nullptr;
  const InstanceView* instances = nullptr;
  TreeExtent extent{};
  // Rays that begin much farther away are moved. Derived from the meshes' own boxes, because t must not depend on
  // trees.
  float reach = 0.0f;
  float scale = 1.0f;             // boxes are stored times this power of two
  std::uint32_t root = kNoChild;  // of the top level
  // The largest instance in the scene's own frame and scale, which never turns: usual rays enter it unmapped. Null:
  // none.
  const InstanceView* in_place = nullptr;
  bool is_empty = true;
  std::size_t tree_bytes = 0;       // bytes that rays may visit
  bool exceeds_cache = false;       // tree_bytes is more than kCachedBytes
  bool repeats_triangles = false;   // some tree holds a triangle in several leaves
  std::uint32_t stack_entries = 0;  // the most that any ray may need
  // The first instance's map to the world (columns x, y, z, translation), and the bytes from each to the next.
  const double* places = nullptr;
  std::size_t place_stride = 0;
  // Null unless something in the scene moves within the shutter.
  const MotionView* motions = nullptr;
  bool is_mostly_still = false;  // most of the instances' boxes, by surface, do not move
  const TreeStep* top_steps = nullptr;
  StepTimes top_times;
  Interruption interruption;
};

struct RayBatch {
  const Ray* rays = nullptr;
  std::size_t count = 0;
  Cull cull = Cull::kNone;
  RayCounts* counts = nullptr;       // null: not requested
  Hit* hits = nullptr;               // closest hit: one per ray
  std::uint8_t* occluded = nullptr;  // any hit: one per ray
  // Null, or the `count` rows to trace, in this order; other rows are not touched. Not for find_all_hits().
  const std::uint32_t* order = nullptr;
};
static inline std::size_t row_of(const RayBatch& batch, std::size_t i) noexcept {
  return batch.order != nullptr ? batch.order[i] : i;
}

// A query for the nearest point. Finds nothing if the point is not finite or the distance is negative or NaN.
struct PointQuery {
  double position[3];
  double max_distance;  // inclusive
  std::uint32_t mask;   // an instance is seen if it shares a bit
  float time = 0.0f;    // within the shutter, as for a ray
};

// The nearest point is (1-u-v) v0 + u v1 + v v2 of the triangle. The indices are kNoHit if there is none.
struct NearestPoint {
  double squared, u, v;  // squared: the squared distance
  std::uint32_t instance_index, primitive_index;
};

// One of all the hits of a ray. t is the one that trace_closest() would find.
struct FoundHit {
  double t;
  float u, v;
  std::uint32_t instance_index, primitive_index;
};

// The hits of a batch, ray after ray. A ray's hits are in any order, and a triangle is repeated as often as the tree
// holds it. Curves and points are hit where the ray enters them (v = 0) and where it leaves them (v = 1).
struct FoundHits {
  FoundHit* hits = nullptr;  // null: only the counts are requested
  std::size_t capacity = 0;
  std::size_t* counts = nullptr;  // one per ray
};

// Gathered spheres ----------------------------------------------------------------------------------------------------
// The spheres of a leaf of curves or points, in the form that is tested: read from the mesh and converted to the tree's
// scale.

// Each primitive's two spheres (a point's are the same), as x, y, z and radius in the tree's scale.
struct alignas(32) GatheredBalls {
  float first[4][8], last[4][8];
};

// Leaf line -----------------------------------------------------------------------------------------------------------
// A ray as the filter of a leaf of curves or points uses it: in the leaf's steps, from the leaf's corner.

struct alignas(16) LeafLine {
  float nearest[4];              // the line's point nearest to the corner, relative to it; the fourth is unused
  float direction[4];            // the ray's
  float least, most;             // hits are between these depths: the dot products with the path from that point
  float away;                    // largest component of that point
  float squared_length, length;  // of the direction
  float slack;                   // bound of the errors of double arithmetic and underflow
};

}  // namespace perfect_bvh
