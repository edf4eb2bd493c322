// What kernels see of what moves within the shutter: plain structs, as in scene_view.h.
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

// A tree at one step: all steps of a tree have the same nodes and leaves, with the boxes and vertices of their time.
struct TreeStep {
  const WideNode* nodes;
  LeafView leaves;
};

// Of an instance that moves: itself, its mesh, or both. What rays read of it is one line of the cache.
struct alignas(64) MotionView {
  const TreeStep* trees = nullptr;  // null: the mesh keeps its shape
  const TurnBack* backs = nullptr;  // null: the instance stays where it is
  StepTimes tree_times, turn_times;
  double centre[3] = {0, 0, 0};     // where the tree's frame has its origin in the mesh's own, which is what turns
  const TurnStep* turns = nullptr;  // null with `backs`
};
static_assert(offsetof(MotionView, turns) == 64);

// Scene view ----------------------------------------------------------------------------------------------------------
// What kernels see of a scene, of rays and of hits: plain structs, nothing that could emit code.

// The leaves of a tree over curves or points, and where what they name is: in the mesh, in its own scale.
struct RoundLeaves {
  const PointLeaf* points = nullptr;
  const CurveLeaf* curves = nullptr;  // instead of points, if not null
  RoundList round;

  // The eight places of a leaf.
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
  std::uint32_t mask;  // 0 for an instance over nothing
  std::uint16_t mirrored;
  std::uint16_t is_round;  // it is over curves or points
  std::int32_t id;
  std::int64_t order;
  float scale;           // of the tree as stored
  std::uint32_t motion;  // a row among the scene's motions, plus one; 0: it does not move within the shutter
};
static_assert(sizeof(InstanceView) == 192);  // every ray that enters an instance reads all of it

// Where rays may visit more bytes than this, what they visit next is fetched ahead. Measured with diffuse rays and a
// second level cache of 2 MB: through 27 MB they are 1.4 times as fast, through 7.7 MB 1.3, 4.1 MB 1.2, 2.8 MB 1.1.
inline constexpr std::size_t kCachedBytes = std::size_t{2} << 20;

// How kernels learn that they should stop. Asked at least every kStepsBetweenAsking steps; a step is at most
// kMostRaysInFlight leaves or instances. After a stop, the answers of the batch mean nothing. `should_stop` may call
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
  // Rays that begin much further away are moved. Of the meshes' own boxes: t must not depend on trees.
  float reach = 0.0f;
  float scale = 1.0f;             // boxes are stored times this power of two
  std::uint32_t root = kNoChild;  // of the top level
  bool is_empty = true;
  std::size_t tree_bytes = 0;       // that rays may visit
  bool exceeds_cache = false;       // those are more than kCachedBytes
  bool repeats_triangles = false;   // some tree holds a triangle in several leaves
  std::uint32_t stack_entries = 0;  // the most that any ray can need
  // The first instance's map to the world (columns x, y, z, translation), and how many bytes to the next one's.
  const double* places = nullptr;
  std::size_t place_stride = 0;
  // Of a scene in which anything moves within the shutter; otherwise null.
  const MotionView* motions = nullptr;
  bool is_mostly_still = false;  // of the instances' boxes more stand still, by their surface
  const TreeStep* top_steps = nullptr;
  StepTimes top_times;
  Interruption interruption;
};

struct RayBatch {
  const Ray* rays = nullptr;
  std::size_t count = 0;
  Cull cull = Cull::kNone;
  RayCounts* counts = nullptr;       // null: not wanted
  Hit* hits = nullptr;               // closest hit: one a ray
  std::uint8_t* occluded = nullptr;  // any hit: one a ray
  // Null, or the rows to trace, in this order, `count` of them; the others are left alone. Not for find_all_hits().
  const std::uint32_t* order = nullptr;
};
static inline std::size_t row_of(const RayBatch& batch, std::size_t i) noexcept {
  return batch.order != nullptr ? batch.order[i] : i;
}

// Finds nothing if the point is not finite or the distance negative or NaN.
struct PointQuery {
  double position[3];
  double max_distance;  // so far away still counts
  std::uint32_t mask;   // an instance is seen if it shares a bit
  float time = 0.0f;    // within the shutter, as a ray's
};

// The point is (1-u-v) v0 + u v1 + v v2 of the triangle; the indices are kNoHit if there is none.
struct NearestPoint {
  double squared, u, v;  // squared: of the distance
  std::uint32_t instance_index, primitive_index;
};

// One of all the triangles that a ray meets. t is what trace_closest() would find.
struct FoundHit {
  double t;
  float u, v;
  std::uint32_t instance_index, primitive_index;
};

// The hits of a batch, ray after ray, each ray's in no order, and a triangle as often as the tree holds it. Curves and
// points are met where they are entered (v = 0) and where they are left (v = 1).
struct FoundHits {
  FoundHit* hits = nullptr;  // null: only the counts are wanted
  std::size_t capacity = 0;
  std::size_t* counts = nullptr;  // one a ray
};

// Gathered balls ------------------------------------------------------------------------------------------------------
// Balls of a leaf of curves or points as they are tested: read from the mesh and brought to the tree's scale.

// Each primitive's two balls (a point's are the same), as x, y, z and radius in the tree's scale.
struct alignas(32) GatheredBalls {
  float first[4][8], last[4][8];
};

// Leaf line -----------------------------------------------------------------------------------------------------------
// A ray as the filter of a leaf of curves or points has it: in the leaf's steps, from the leaf's corner.

struct alignas(16) LeafLine {
  float nearest[4];              // the line's point nearest to the corner, from there; the fourth means nothing
  float direction[4];            // the ray's
  float least, most;             // hits are between these depths: the direction times the way from that point
  float away;                    // largest component of that point
  float squared_length, length;  // of the direction
  float slack;                   // what double does to the ray, and underflow
};

}  // namespace perfect_bvh
