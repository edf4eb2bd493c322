// From the meshes' trees to a snapshot that can be traced: every instance is placed, the tree over them built or
// refitted, and both laid out for the kernels.
// In: meshes, placements; the snapshot with the top level of the one before it, or without. Out: the snapshot, but for
// its generation and scene, and how its top level was made.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>

#include "builders/build_config.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "stats/commit_report.h"
#include "tlas/instance.h"
#include "tlas/snapshot.h"

namespace perfect_bvh {

// A mesh that instances show.
struct PlacedMesh {
  std::shared_ptr<const Blas> blas;
  BuildConfig bake_config;  // of copies in world space
  std::uint32_t user_count = 0;
};
using PlacedMeshes = std::map<std::int32_t, PlacedMesh>;  // by mesh id

// expected_rays: see is_worth_keeping(). Throws Cancelled, bad_alloc; the snapshot is then of no use.
TopLevelReport assemble(Snapshot& snapshot, const PlacedMeshes& meshes, std::span<const Placement> placements,
                        std::optional<double> expected_rays, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
