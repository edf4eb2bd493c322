// A wide tree as a scene of one instance, to be traced like any other.
#pragma once

#include <memory>

#include "mesh/triangle_mesh.h"
#include "tlas/snapshot.h"

namespace perfect_bvh::bench {

[[nodiscard]] std::shared_ptr<const Snapshot> snapshot_over(std::shared_ptr<const TriangleMesh> mesh, WideBvh wide);

}  // namespace perfect_bvh::bench
