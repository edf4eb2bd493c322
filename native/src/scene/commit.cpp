// Scene::commit: from edits to a new snapshot. Everything new is made aside and swapped in at the end; only the last
// snapshot's memory is used again where nobody can see it any more. So an exception anywhere leaves the edits waiting.

#include <algorithm>
#include <utility>

#include "core/stopwatch.h"
#include "scene/blas_build.h"
#include "scene/scene.h"

namespace perfect_bvh {
namespace {

std::size_t byte_count(const Snapshot& snapshot) {
  std::size_t count = snapshot.instances.size() * (sizeof(Instance) + sizeof(InstanceView)) +
                      snapshot.tlas.byte_count() + snapshot.top_level.byte_count();
  for (const auto& blas : snapshot.blases) count += blas->mesh.byte_count() + blas->wide.byte_count();
  return count;
}

}  // namespace

std::vector<Scene::BlasResult> Scene::make_changed_blases(ThreadPool& pool, CancelToken& cancel) const {
  std::vector<const std::pair<const std::int32_t, MeshSlot>*> changed;
  std::size_t triangle_count = 0;
  for (const auto& entry : meshes_) {
    if (!entry.second.edited) continue;
    changed.push_back(&entry);
    triangle_count += entry.second.edited->triangle_count();
  }
  cancel.expect(triangle_count);
  std::vector<BlasResult> results(changed.size());
  const auto make = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      cancel.throw_if_stopped();
      results[i] = make_blas(changed[i]->first, changed[i]->second, pool, cancel);
    }
  };
  parallel_for(pool, changed.size(), 1, make, 0, [&] {
    cancel.poll();
    cancel.throw_if_stopped();
  });
  return results;
}

// What the next snapshot begins as: the last one with its arrays, which are the largest part of a scene of many
// instances, or, where somebody holds that, a copy of its trees. While edits wait nobody can ask for it.
std::shared_ptr<Snapshot> Scene::take_last_snapshot() {
  const std::lock_guard lock(state_mutex_);
  if (snapshot_.use_count() == 1) {
    // Others may have just let go of it: a copy that comes and goes is ordered after all that they read.
    std::shared_ptr<const Snapshot>(snapshot_).reset();
    return std::const_pointer_cast<Snapshot>(std::exchange(snapshot_, nullptr));
  }
  auto snapshot = std::make_shared<Snapshot>();
  if (!snapshot_) return snapshot;
  snapshot->tlas = snapshot_->tlas, snapshot->top_level = snapshot_->top_level;
  snapshot->top_level_builder = snapshot_->top_level_builder, snapshot->built_cost = snapshot_->built_cost;
  return snapshot;
}

CommitReport Scene::commit(ThreadPool& pool, CancelToken& cancel) {
  const std::lock_guard edit_lock(edit_mutex_);
  const Stopwatch watch;
  CommitReport report;
  report.instance_count = instances_.size();
  const std::uint64_t stale_count = [&] {
    const std::lock_guard lock(state_mutex_);
    return stale_count_;
  }();
  auto results = make_changed_blases(pool, cancel);
  report.kept_count = meshes_.size() - results.size();
  report.mesh_milliseconds = watch.milliseconds();

  std::shared_ptr<const Snapshot> snapshot = snapshot_;
  if (!snapshot || edit_count_ != committed_edit_count_) {  // else what is committed is what there is: keep it
    BlasMap blases;
    for (const auto& [mesh_id, slot] : meshes_) blases[mesh_id] = slot.blas;
    for (const BlasResult& result : results) blases[result.report.mesh_id] = result.blas;
    snapshot.reset();
    auto assembled = take_last_snapshot();
    assemble(*assembled, blases, pool, cancel, report.top_level);
    assembled->generation = generation_ + 1;
    assembled->scene_id = id_;
    snapshot = std::move(assembled);
  } else {
    report.top_level.reason = "nothing was edited";
  }
  report.baked_count = snapshot->blases.size() - snapshot->meshes.size();
  report.top_level.builder = snapshot->top_level_builder;
  report.byte_count = byte_count(*snapshot);
  report.generation = snapshot->generation;
  report.milliseconds = watch.milliseconds();
  report.top_level_milliseconds = report.milliseconds - report.mesh_milliseconds;
  report.meshes.reserve(results.size());
  for (BlasResult& result : results) report.meshes.push_back(std::move(result.report));
  publish(std::move(snapshot), results, report, stale_count);
  return report;
}

// Nothing here throws: a commit that came so far happens as a whole.
void Scene::publish(std::shared_ptr<const Snapshot> snapshot, std::span<BlasResult> results, const CommitReport& report,
                    std::uint64_t stale_count) noexcept {
  for (auto& [mesh_id, slot] : meshes_) {
    if (!slot.edited && slot.spare) static_cast<void>(slot.spare->take());  // it stopped moving
  }
  for (std::size_t i = 0; i < results.size(); ++i) {
    MeshSlot& slot = meshes_.find(report.meshes[i].mesh_id)->second;
    slot.blas = std::move(results[i].blas);
    slot.spare = slot.blas->spare;
    slot.edited.reset();
    slot.same_topology = false;
  }
  const std::lock_guard state_lock(state_mutex_);
  snapshot_ = std::move(snapshot);
  generation_ = snapshot_->generation;
  committed_edit_count_ = edit_count_;
  if (stale_count == stale_count_) stale_reason_.clear();  // marked meanwhile: what was committed is already old
}

}  // namespace perfect_bvh
