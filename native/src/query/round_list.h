// A mesh's curves or points as formulas take them, in the mesh's own scale.
#pragma once

#include "math/curve_joint.h"
#include "mesh/mesh.h"

namespace perfect_bvh {

// moment: of a mesh that moves within the shutter.
[[nodiscard]] inline RoundList round_list(const Mesh& mesh, const Moment& moment = {}) noexcept {
  RoundList list{mesh.at_step(moment.step).balls.data(), mesh.segments.data(), 1.0f, mesh.shape};
  list.closed = mesh.closed.data(), list.closed_count = mesh.closed.size();
  if (moment.is_between()) list.later = mesh.at_step(moment.step + 1).balls.data(), list.moment = moment;
  return list;
}

}  // namespace perfect_bvh
