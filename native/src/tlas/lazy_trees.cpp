#include "tlas/lazy_trees.h"

#include <algorithm>

#include "blas/deferred_tree.h"
#include "core/steps.h"
#include "core/thread_pool.h"
#include "tlas/trace_view.h"

namespace perfect_bvh {

std::shared_ptr<LazyTrees> LazyTrees::of(Snapshot& snapshot, CancelToken& cancel) {
  const auto is_deferred = [](const auto& blas) { return blas->deferred != nullptr; };
  if (std::none_of(snapshot.blases.begin(), snapshot.blases.end(), is_deferred)) return nullptr;
  std::shared_ptr<LazyTrees> trees(new LazyTrees(snapshot));
  for_steps(snapshot.instances.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const Blas* const blas = snapshot.instances[row].blas;
      if (blas->deferred) trees->rows_[blas].push_back(static_cast<std::uint32_t>(row));
    }
  });
  trees->missing_count_ = trees->rows_.size();
  return trees->rows_.empty() ? nullptr : trees;
}

bool LazyTrees::Attempt::should_stop(void* context) noexcept {
  auto& attempt = *static_cast<Attempt*>(context);
  if (!attempt.cancel.is_due()) return attempt.cancel.stop_requested();
  attempt.views.unlock();
  const bool stops = attempt.cancel.ask();
  attempt.views = attempt.trees.hold_views();
  attempt.is_outdated = attempt.missing_count != attempt.trees.missing_count_.load(std::memory_order_relaxed);
  return stops || attempt.is_outdated;
}

void LazyTrees::build(const UnbuiltInstances& reached, CancelToken& cancel) {
  std::vector<const Blas*> meshes;
  for (std::uint32_t i = 0; i < reached.count; ++i) meshes.push_back(snapshot_.instances[reached.rows[i]].blas);
  std::sort(meshes.begin(), meshes.end());
  meshes.erase(std::unique(meshes.begin(), meshes.end()), meshes.end());
  ThreadPool& pool = ThreadPool::shared();
  const auto make = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) show(*meshes[i], meshes[i]->deferred->get(pool, cancel));
  };
  parallel_for(pool, meshes.size(), 1, make, 0, [&] { cancel.checkpoint(); });
}

void LazyTrees::show(const Blas& mesh, const Blas& built) {
  const std::lock_guard turn(turn_);
  const std::lock_guard views(views_mutex_);
  const auto found = rows_.find(&mesh);
  if (found == rows_.end()) return;  // another thread did
  admit_tree(snapshot_.view, snapshot_.top_level, built.wide);
  for (const std::uint32_t row : found->second) {
    snapshot_.instance_views[row] = view_of_built(snapshot_.instances[row], built, snapshot_.top_level.scale);
  }
  rows_.erase(found);
  missing_count_.fetch_sub(1, std::memory_order_release);
}

}  // namespace perfect_bvh
