// One placed mesh: a BLAS seen through a transform (lecture, "Rigid motion"). The inverse, which rays are transformed
// by, stands in the row's InstanceView; its world box in the top level's leaf.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "builders/build_config.h"
#include "math/affine.h"
#include "mesh/triangle_mesh.h"
#include "scene/cover.h"
#include "scene/spare_tree.h"
#include "scene/support.h"
#include "traverse/scene_view.h"
#include "update/quality.h"
#include "wide/refit_plan.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

class DeferredTree;
struct WideCosts;

// The tree of one distinct mesh, with its geometry. Immutable once a snapshot refers to it.
struct Blas {
  explicit Blas(std::shared_ptr<const TriangleMesh> the_mesh) : owned_mesh(std::move(the_mesh)), mesh(*owned_mesh) {}
  Blas(const Blas&) = delete;
  Blas& operator=(const Blas&) = delete;
  ~Blas() {
    if (spare) spare->give({std::move(wide), shape});
  }

  const std::shared_ptr<const TriangleMesh> owned_mesh;
  const TriangleMesh& mesh;
  BuildConfig config;   // that the tree was built with, its builder named; refits keep it
  TreeQuality quality;  // of the binary tree that `wide` was made from; empty where there was none, or it was refitted
  WideBvh wide;         // what rays are traced through
  IndexedLeaves indexed_leaves;  // of `wide`, in the compact layout
  std::uint64_t shape = 0;
  std::shared_ptr<const WideCosts> fresh_costs;  // of each part of `wide` when it was built; null before it is refitted
  RefitPlan refit_plan;                          // of `wide`; likewise
  std::shared_ptr<SpareTree> spare;              // where `wide` goes at the end; null: nowhere
  LazySupport support;                           // of `wide`, where many instances ask for it
  Cover cover;                                   // a few boxes that hold the whole mesh
  // Of a mesh that is built when the first ray reaches it, else null. There is then no tree here, only the one to come.
  std::shared_ptr<DeferredTree> deferred;
};

struct Instance {
  std::int32_t id = -1;       // the scene's stable id
  std::int32_t mesh_id = -1;  // the scene's stable id
  std::uint32_t mask = 0xFFFFFFFFu;
  bool mirrored = false;   // the transform turns the winding round
  bool baked = false;      // blas is a copy in world space, for want of a usable inverse
  std::int64_t order = 0;  // breaks ties between hits at equal t: the smaller order wins, then the smaller primitive
  const Blas* blas = nullptr;
  Affine object_to_world;  // from the mesh's stored (recentred) frame
};

}  // namespace perfect_bvh
