// A mesh or its wide tree as a scene of one instance without a transform.
#pragma once

#include <memory>

#include "blas/build_tree.h"
#include "builders/builder.h"
#include "mesh/mesh.h"
#include "tlas/assemble.h"

namespace perfect_bvh::bench {

[[nodiscard]] std::shared_ptr<const Snapshot> snapshot_over(std::shared_ptr<const Mesh> mesh, WideBvh wide);

// Adds and commits on one thread, as a user would.
[[nodiscard]] std::shared_ptr<const Snapshot> committed(const Mesh& mesh, const BuildConfig& config,
                                                        Usage usage = Usage::kStatic);

}  // namespace perfect_bvh::bench
