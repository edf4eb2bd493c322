// One placed mesh: a BLAS seen through a transform (lecture, "Rigid motion"). The inverse, which transforms rays, is in
// the row's InstanceView; its world box is in the top level's leaf.
#pragma once

#include <cstdint>
#include <memory>

#include "blas/blas.h"
#include "builders/builder.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/aabb.h"
#include "tlas/turns.h"

namespace perfect_bvh {

// An instance as requested by the caller.
struct Placement {
  std::int32_t id, mesh_id;
  Affine object_to_world;
  std::uint32_t mask;
  std::int64_t order;
  std::shared_ptr<const Turns> turns = nullptr;  // null: it does not move within the shutter
};

struct Instance {
  using Overwritten = void;   // AlignedVector::resize() leaves its rows uninitialized
  std::int32_t id = -1;       // the scene's stable id
  std::int32_t mesh_id = -1;  // the scene's stable id
  std::uint32_t mask = 0xFFFFFFFFu;
  bool mirrored = false;   // the transform reverses the winding
  bool baked = false;      // blas is a copy in world space, because no inverse is usable
  std::int64_t order = 0;  // breaks ties between hits at equal t: the smaller order wins, then the smaller primitive
  const Blas* blas = nullptr;
  Affine object_to_world;  // from the mesh's stored (recentred) frame; for a moving instance, at the shutter's opening
  std::uint32_t motion = 0;      // its row among the snapshot's motions, plus one; 0: neither it nor its mesh moves
  const Turns* turns = nullptr;  // owned by the snapshot; null: the instance does not move
};

// Returns the transform from the mesh's stored frame, at a time.
[[nodiscard]] Affine place_at(const Instance& instance, float time);
[[nodiscard]] inline Moment moment_of(const Instance& instance, float time) noexcept {
  const Mesh& mesh = instance.blas->mesh;
  return mesh.moves() ? moment_at(mesh.times, time) : Moment{};
}
// Returns the instance placed as at a time, without its own motion. Its mesh still moves.
[[nodiscard]] Instance posed(const Instance& instance, float time);

// The placement of an instance, from which its top-level row and the kernels' view are made.
struct Placing {
  Affine world_to_object;  // to the mesh's stored (recentred) frame
  Aabb world_bounds;       // rounded outward; empty if the mesh is
};

// Fills in the blas, transform and facing of `instance`, unbaked, for the mesh of `blas`, and `placing`. Returns false
// if the transform has no usable inverse: the inverse of a transform flattened by a zero scale is not finite, or
// mapping there and back has a larger error than float's. The instance must then be baked. `is_worth_table`: takes the
// bounds from a table of the mesh's support, which may have to be made, and not from its vertices.
[[nodiscard]] bool place_instance(Instance& instance, Placing& placing, const Blas& blas, const Affine& object_to_world,
                                  bool is_worth_table = false);

// Returns the world box of a placed instance's mesh box, which does not depend on its tree.
[[nodiscard]] inline Aabb mesh_bounds_of(const Instance& instance) noexcept {
  return transformed_box(instance.blas->box, instance.object_to_world);
}

// Makes a copy of the mesh in world space, with its own tree and an identity transform, so that a flattened object is
// still visible. Curves and points are solids, which vanish when flattened: their copy is empty.
[[nodiscard]] std::shared_ptr<const Blas> bake_instance(Instance& instance, Placing& placing, const Blas& blas,
                                                        const Affine& object_to_world, const BuildConfig& config,
                                                        ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
