// An immutable two-level tree that rays are traced through. Any number of threads may share one while its scene is
// edited and committed again.
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
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "stats/statistics.h"
#include "tlas/instance.h"
#include "tlas/top_level.h"
#include "traverse/scene_view.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

struct Snapshot {
  std::vector<std::shared_ptr<const Blas>> blases;           // keeps the instances' trees alive
  std::vector<std::pair<std::int32_t, const Blas*>> meshes;  // by mesh id; without baked copies
  AlignedVector<Instance> instances;                         // by ascending scene id
  WideBvh top_level;                                         // over the instances' world boxes
  AlignedVector<InstanceView> instance_views;                // the kernels' views of `instances`, row by row
  std::vector<std::shared_ptr<const Turns>> turns;           // of instances that move within the shutter
  AlignedVector<MotionView> motions;                         // of those, and of instances of moving meshes
  bool is_mostly_still = false;                              // most of the instances' boxes, by surface, do not move
  // If anything moves: the top level at evenly spaced times. Empty if one top level, around all motion, serves all
  // times.
  std::vector<WideBvh> top_steps;
  std::vector<TreeStep> top_step_views;  // the kernels' views of them, or of the one
  SceneView view;                        // points into this snapshot
  Aabb bounds;                           // around the meshes' own boxes, placed; does not depend on trees
  Aabb lone_box;                         // the world box of a top level's only instance
  const char* top_level_builder = "";    // the builder of `top_level`
  bool has_round_meshes = false;         // some mesh consists of curves or points
  bool tried_clustering = false;         // when the top level was built
  TopLevelCost built_cost;               // of the top level when it was built
  std::uint64_t generation = 0;
  std::uint64_t scene_id = 0;  // identifies the scene in this process
  // The rays cast by all users, if the scene's owner counts them; otherwise null. The scene's snapshots share one
  // counter.
  std::shared_ptr<std::atomic<std::uint64_t>> rays_cast;
};

// Returns the bytes of the instances' motions and the top level's steps.
[[nodiscard]] inline std::size_t motion_byte_count(const Snapshot& snapshot) noexcept {
  std::size_t count = snapshot.motions.size() * sizeof(MotionView);
  for (const auto& turns : snapshot.turns) count += turns->byte_count();
  for (const WideBvh& step : snapshot.top_steps) count += step.byte_count();
  return count;
}

// Counts the rays of a batch that was traced.
inline void count_rays(const Snapshot& snapshot, std::size_t count) noexcept {
  if (snapshot.rays_cast) snapshot.rays_cast->fetch_add(count, std::memory_order_relaxed);
}

// Trace view ----------------------------------------------------------------------------------------------------------
// The kernels' view of a snapshot.

// Returns the row of a placed instance. Its tree may have its own scale; the world's scale is applied later.
[[nodiscard]] InstanceView view_of(const Instance& instance, const Affine& world_to_object);

// Fills in `view` and converts `instance_views` to the world's scale. Everything else in the snapshot must be complete.
void make_trace_view(Snapshot& snapshot, ThreadPool& pool, CancelToken& cancel);

// Calls trace(view) for a snapshot's view. Checks `cancel` before that, and regularly during it: its callback may cast
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
// Assembles a traceable snapshot from the meshes' trees: places every instance, builds or refits the tree over them,
// and converts both to the kernels' layout.
// In: meshes, placements; the snapshot, with or without the previous top level. Out: the snapshot, except its
// generation and scene, and a report on its top level.

// A mesh that has instances.
struct PlacedMesh {
  std::shared_ptr<const Blas> blas;
  BuildConfig bake_config;  // of copies in world space
  std::uint32_t user_count = 0;
};
using PlacedMeshes = std::map<std::int32_t, PlacedMesh>;  // by mesh id

// expected_rays: see is_worth_keeping(). Throws Cancelled, bad_alloc; the snapshot is then unusable.
TopLevelReport assemble(Snapshot& snapshot, const PlacedMeshes& meshes, std::span<const Placement> placements,
                        std::optional<double> expected_rays, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
