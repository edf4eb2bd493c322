// One placed mesh: a BLAS seen through a transform (lecture, "Rigid motion"). The inverse, which rays are transformed
// by, stands in the row's InstanceView; its world box in the top level's leaf.
#pragma once

#include <cstdint>

#include "blas/blas.h"
#include "math/affine.h"

namespace perfect_bvh {

// An instance as it was asked for.
struct Placement {
  std::int32_t id, mesh_id;
  Affine object_to_world;
  std::uint32_t mask;
  std::int64_t order;
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
