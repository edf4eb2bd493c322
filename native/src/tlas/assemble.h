// An immutable two-level tree: what rays are traced through. Any number of threads may share one while the scene
// it came from is edited and committed again.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "builders/builder.h"
#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "stats/statistics.h"
#include "tlas/instance.h"
#include "tlas/top_level.h"
#include "traverse/scene_view.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

struct Snapshot {
  std::vector<std::shared_ptr<const Blas>> blases;           // keeps alive what the instances point to
  std::vector<std::pair<std::int32_t, const Blas*>> meshes;  // by mesh id; baked copies are not among them
  AlignedVector<Instance> instances;                         // in the order of their scene ids
  Bvh2 tlas;                                                 // over the instances' world boxes
  WideBvh top_level;                                         // the same, as rays are traced through it
  AlignedVector<InstanceView> instance_views;                // what kernels see of `instances`, row by row
  std::vector<std::shared_ptr<const Turns>> turns;           // of instances that move within the shutter
  AlignedVector<MotionView> motions;                         // of those and of instances of meshes that do
  bool is_mostly_still = false;                              // of the instances' boxes more stand still, by surface
  // If any does: the top level at evenly spaced times; none where it serves all of them, around all ways.
  std::vector<WideBvh> top_steps;
  std::vector<TreeStep> top_step_views;  // what kernels see of them, or of that one
  SceneView view;                        // points into this snapshot
  Aabb bounds;                           // around the meshes' own boxes, placed: whatever the trees
  const char* top_level_builder = "";    // that made `tlas`
  bool has_round_meshes = false;         // some mesh is of curves or points
  bool tried_clustering = false;         // when it was built
  TopLevelCost built_cost;               // of the top level then
  std::uint64_t generation = 0;
  std::uint64_t scene_id = 0;  // which scene of the process
  // By all who trace it, where the scene's owner wants to know; null otherwise. The scene's snapshots share one.
  std::shared_ptr<std::atomic<std::uint64_t>> rays_cast;
};

// Of the instances' motions and the top level's steps.
[[nodiscard]] inline std::size_t motion_byte_count(const Snapshot& snapshot) noexcept {
  std::size_t count = snapshot.motions.size() * sizeof(MotionView);
  for (const auto& turns : snapshot.turns) count += turns->byte_count();
  for (const WideBvh& step : snapshot.top_steps) count += step.byte_count();
  return count;
}

// Of a batch that was traced.
inline void count_rays(const Snapshot& snapshot, std::size_t count) noexcept {
  if (snapshot.rays_cast) snapshot.rays_cast->fetch_add(count, std::memory_order_relaxed);
}

// Trace view ----------------------------------------------------------------------------------------------------------
// What kernels see of a snapshot.

// The row of a placed instance. Its tree may be stored in a scale of its own; the world's comes in later.
[[nodiscard]] InstanceView view_of(const Instance& instance, const Affine& world_to_object);

// Fills in `view` and brings `instance_views` to the world's scale, after everything else of the
// snapshot is in place.
void make_trace_view(Snapshot& snapshot, ThreadPool& pool, CancelToken& cancel);

// Calls trace(view) for a snapshot's view. Asks `cancel` before and, every so many steps, within: its callback may cast
// rays through the same snapshot. Throws Cancelled.
template <class Trace>
void with_view(const Snapshot& snapshot, CancelToken& cancel, Trace&& trace) {
  cancel.checkpoint();
  SceneView view = snapshot.view;
  view.interruption = {[](void* token) noexcept { return static_cast<CancelToken*>(token)->ask(); }, &cancel};
  trace(view);
  cancel.throw_if_stopped();
}

// Assemble ------------------------------------------------------------------------------------------------------------
// From the meshes' trees to a snapshot that can be traced: every instance is placed, the tree over them built or
// refitted, and both laid out for the kernels.
// In: meshes, placements; the snapshot with the top level of the one before it, or without. Out: the snapshot, but for
// its generation and scene, and how its top level was made.

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
