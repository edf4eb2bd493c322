// What kernels see of a scene, of rays and of hits: plain structs, nothing that could emit code.
#pragma once

#include <cstddef>
#include <cstdint>

#include "math/slab.h"
#include "math/vec3.h"
#include "stats/ray_counts.h"
#include "traverse/ray.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// The leaves of a compact tree, and where their vertices are: in the mesh, in its own scale. A mesh's positions are
// readable for kReadableBehind bytes past the last.
struct IndexedLeaves {
  const IndexedLeaf* rows = nullptr;
  const Vec3<std::uint32_t>* triangles = nullptr;
  const Vec3f* positions = nullptr;
  float scale = 1.0f;  // of the tree as stored
};

struct alignas(64) InstanceView {
  // Columns x, y, z, translation, from the scene's scale to the tree's; the fourth row is 0.
  alignas(32) double world_to_local[4][4];
  const WideNode* nodes;
  union {
    const LeafBlock* blocks;              // of the default layout
    const IndexedLeaves* indexed_leaves;  // of the compact one
  };
  TreeExtent extent;
  std::uint32_t root;
  std::uint32_t mask;  // 0 for an instance over nothing
  std::uint16_t mirrored;
  std::uint16_t is_compact;
  std::int32_t id;
  std::int64_t order;
  float scale;  // of the tree as stored
};
static_assert(sizeof(InstanceView) == 192);  // every ray that enters an instance reads all of it

struct SceneView {
  const WideNode* nodes = nullptr;
  const InstanceView* instances = nullptr;
  TreeExtent extent{};
  float scale = 1.0f;             // boxes are stored times this power of two
  std::uint32_t root = kNoChild;  // of the top level
  bool is_empty = true;
  bool repeats_triangles = false;   // some tree holds a triangle in several leaves
  std::uint32_t stack_entries = 0;  // the most that any ray can need
  // The first instance's map to the world (columns x, y, z, translation), and how many bytes to the next one's.
  const double* places = nullptr;
  std::size_t place_stride = 0;
};

struct RayBatch {
  const Ray* rays = nullptr;
  std::size_t count = 0;
  Cull cull = Cull::kNone;
  RayCounts* counts = nullptr;       // null: not wanted
  Hit* hits = nullptr;               // closest hit: one a ray
  std::uint8_t* occluded = nullptr;  // any hit: one a ray
  Precision precision = Precision::kRobust;
};

// Finds nothing if the point is not finite or the distance negative or NaN.
struct PointQuery {
  double position[3];
  double max_distance;  // so far away still counts
  std::uint32_t mask;   // an instance is seen if it shares a bit
};

// The point is (1-u-v) v0 + u v1 + v v2 of the triangle; the indices are kNoHit if there is none.
struct NearestPoint {
  double squared, u, v;  // squared: of the distance
  std::uint32_t instance_index, primitive_index;
};

// One of all the triangles that a ray meets. t is what trace_closest() would find, before it is narrowed.
struct FoundHit {
  double t;
  float u, v;
  std::uint32_t instance_index, primitive_index;
};

// The hits of a batch, ray after ray, each ray's in no order, and a triangle as often as the tree holds it.
struct FoundHits {
  FoundHit* hits = nullptr;  // null: only the counts are wanted
  std::size_t capacity = 0;
  std::size_t* counts = nullptr;  // one a ray
};

}  // namespace perfect_bvh
