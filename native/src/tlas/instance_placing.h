// Where a placed mesh stands: its inverse transform, its world box, and what to do without an inverse.
#pragma once

#include <memory>

#include "builders/build_config.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "tlas/instance.h"

namespace perfect_bvh {

struct Placing {
  Affine world_to_object;  // to the mesh's stored (recentred) frame
  Aabb world_bounds;       // rounded outward; empty if the mesh is
};

// Fills in the blas, transform and facing of `instance` for the mesh of `blas`, and `placing`. False if the transform
// has no usable inverse (flattened by a zero scale: the inverse is not finite, or mapping there and back does not
// return within float's error); the instance must then be baked.
// `support`, if there is one, is that of the mesh: closer bounds.
[[nodiscard]] bool place_instance(Instance& instance, Placing& placing, const Blas& blas, const Affine& object_to_world,
                                  const SupportTable* support = nullptr);

// A copy of the mesh in world space, with its own tree and an identity transform: so a flattened object is still seen.
[[nodiscard]] std::shared_ptr<const Blas> bake_instance(Instance& instance, Placing& placing, const Blas& blas,
                                                        const Affine& object_to_world, const BuildConfig& config,
                                                        ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
