#include <algorithm>
#include <cmath>
#include <utility>

#include "blas/build_tree.h"
#include "blas/make_blas.h"
#include "core/cancel.h"
#include "scene/ray_shares.h"
#include "scene/scene.h"

namespace perfect_bvh {
namespace {

Vec3d magnitudes(Vec3d v) noexcept { return {std::abs(v.x), std::abs(v.y), std::abs(v.z)}; }

}  // namespace

void RayShares::add(const Aabb& box, const Affine& map, std::size_t row) noexcept {
  if (box.is_empty()) return;
  const Vec3d least = to_double(box.lower), greatest = to_double(box.upper);
  const Vec3d middle = map.point((least + greatest) * 0.5), half = (greatest - least) * 0.5;
  const Vec3d reach = magnitudes(map.x) * half.x + magnitudes(map.y) * half.y + magnitudes(map.z) * half.z;
  lower_ = is_empty_ ? middle - reach : min(lower_, middle - reach);
  upper_ = is_empty_ ? middle + reach : max(upper_, middle + reach);
  is_empty_ = false;
  if (row != kOther) areas_[row] += half_area(reach * 2.0);
}

double RayShares::of(std::size_t row) const noexcept {
  if (is_empty_) return 0;
  const double whole = half_area(upper_ - lower_);
  return whole > 0 ? areas_[row] / whole : 1;
}

// Commit --------------------------------------------------------------------------------------------------------------
// Scene::commit: makes a new snapshot from edits. Everything new is made separately and swapped in at the end. Only the
// last snapshot's memory is reused, if no query holds it or can request it. So an exception anywhere leaves the edits
// pending and, if there are no edits, the last snapshot.

namespace {

std::size_t byte_count(const Snapshot& snapshot) {
  std::size_t count =
      snapshot.instances.size() * (sizeof(Instance) + sizeof(InstanceView)) + snapshot.top_level.byte_count();
  for (const auto& blas : snapshot.blases) count += byte_count(*blas);
  return count + motion_byte_count(snapshot);
}

}  // namespace

std::vector<BlasResult> Scene::make_blases(std::span<const ChangedMesh> changed, const CommitOptions& options,
                                           ThreadPool& pool, CancelToken& cancel) {
  std::size_t triangle_count = 0;
  for (const ChangedMesh& mesh : changed) {
    const MeshState& state = *mesh.state;
    if (!is_resting(state)) triangle_count += state.edited->primitive_count();
    if (is_resting(state) && !state.has_deformed) triangle_count += state.blas->mesh.primitive_count();
  }
  cancel.expect(2 * triangle_count);  // for a binary tree, then for a wide one
  std::vector<BlasResult> results(changed.size());
  for_chunks(pool, changed.size(), 1, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) results[i] = make_blas(changed[i], options, pool, cancel);
  });
  return results;
}

PlacedMeshes Scene::meshes_to_place(std::span<const BlasResult> results) const {
  PlacedMeshes meshes;
  for (const auto& [mesh_id, slot] : meshes_) {
    meshes[mesh_id] = {slot.blas, choose_builder(slot.config, slot.usage), slot.user_count};
  }
  for (const BlasResult& result : results) {
    if (result.blas) meshes[result.report.mesh_id].blas = result.blas;
  }
  return meshes;
}

// Returns the start of the next snapshot: the last one with its arrays, which are the largest part of a scene of many
// instances, or a copy of its trees if another owner holds it. While edits are pending, no caller can request the last
// snapshot. If a tree is only replaced by a better one, it can still be requested, and stays.
std::shared_ptr<Snapshot> Scene::take_last_snapshot() {
  const std::lock_guard lock(state_mutex_);
  const bool may_be_asked_for = edit_count_ == committed_edit_count_ && stale_reason_.empty();
  if (!may_be_asked_for && snapshot_.use_count() == 1) {
    // Another owner may have just released it: making and dropping a copy synchronizes with all its reads.
    std::shared_ptr<const Snapshot>(snapshot_).reset();
    return std::const_pointer_cast<Snapshot>(std::exchange(snapshot_, nullptr));
  }
  auto snapshot = std::make_shared<Snapshot>();
  if (!snapshot_) return snapshot;
  snapshot->top_level = snapshot_->top_level;
  snapshot->top_level_builder = snapshot_->top_level_builder, snapshot->built_cost = snapshot_->built_cost;
  snapshot->tried_clustering = snapshot_->tried_clustering;
  return snapshot;
}

std::shared_ptr<const Snapshot> Scene::assemble_snapshot(std::span<const BlasResult> results, const RayForecast& rays,
                                                         TopLevelReport& report, ThreadPool& pool,
                                                         CancelToken& cancel) {
  const PlacedMeshes meshes = meshes_to_place(results);
  auto assembled = take_last_snapshot();
  report = assemble(*assembled, meshes, instances_, rays.expected, pool, cancel);
  assembled->generation = generation_ + 1;
  assembled->scene_id = id_;
  assembled->rays_cast = rays_cast_;
  return assembled;
}

CommitReport Scene::commit(ThreadPool& pool, CancelToken& cancel, const CommitOptions& options) {
  const std::lock_guard edit_lock(edit_mutex_);
  const Stopwatch watch;
  CommitReport report;
  report.instance_count = instances_.size();
  const std::uint64_t stale_count = [&] {
    const std::lock_guard lock(state_mutex_);
    return stale_count_;
  }();
  const RayForecast rays = forecast_rays(options);
  auto results = make_blases(find_changed(options, rays, cancel), options, pool, cancel);
  const auto made = static_cast<std::size_t>(
      std::count_if(results.begin(), results.end(), [](const BlasResult& result) { return result.blas != nullptr; }));
  report.kept_count = meshes_.size() - made;
  report.mesh_milliseconds = watch.milliseconds();

  std::shared_ptr<const Snapshot> snapshot;
  if (!snapshot_ || edit_count_ != committed_edit_count_ || made > 0) {
    snapshot = assemble_snapshot(results, rays, report.top_level, pool, cancel);
  } else {
    snapshot = snapshot_;  // nothing changed since the last commit
    report.top_level.reason = "nothing was edited";
  }
  report.baked_count = snapshot->blases.size() - snapshot->meshes.size();
  report.top_level.builder = snapshot->top_level_builder;
  report.byte_count = byte_count(*snapshot);
  report.generation = snapshot->generation;
  report.milliseconds = watch.milliseconds();
  report.top_level_milliseconds = report.milliseconds - report.mesh_milliseconds;
  report.meshes.reserve(made);
  report.resting.reserve(results.size() - made);
  for (const BlasResult& result : results) (result.blas ? report.meshes : report.resting).push_back(result.report);
  publish(std::move(snapshot), results, rays, stale_count);
  return report;
}

// Nothing here throws: from here on, a commit takes effect as a whole.
void Scene::publish(std::shared_ptr<const Snapshot> snapshot, std::span<BlasResult> results, const RayForecast& rays,
                    std::uint64_t stale_count) noexcept {
  for (auto& [mesh_id, slot] : meshes_) {
    if (slot.edited) continue;  // it is still moving
    if (slot.spare) static_cast<void>(slot.spare->take());
    if (slot.spare_positions) static_cast<void>(slot.spare_positions->take());
  }
  for (BlasResult& result : results) {
    MeshSlot& slot = meshes_.find(result.report.mesh_id)->second;
    slot.history = result.history;
    if (!result.blas) continue;
    slot.blas = std::move(result.blas);
    slot.spare = slot.blas->spare;
    slot.cast_before = rays.cast_in_all;
    slot.air.reset();
    slot.edited.reset();
    slot.same_topology = false;
  }
  cast_until_last_commit_ = rays.cast_in_all;
  const std::lock_guard state_lock(state_mutex_);
  snapshot_ = std::move(snapshot);
  generation_ = snapshot_->generation;
  committed_edit_count_ = edit_count_;
  if (stale_count == stale_count_) stale_reason_.clear();  // if marked since, the snapshot is already stale
}

}  // namespace perfect_bvh
