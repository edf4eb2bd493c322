// A tree that is built once, when the first thread asks for it. Threads that ask while it is being built help.
// In: how to build it. Out: the tree, or the error that stopped the build; then nothing is built, and the next thread
// that asks tries again.
#pragma once

#include <functional>
#include <memory>
#include <mutex>

#include "blas/blas.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "update/governor.h"

namespace perfect_bvh {

struct BuiltTree {
  std::shared_ptr<const Blas> blas;  // null: not built
  UpdateHistory history;             // that later commits go by
};

class DeferredTree {
 public:
  using Build = std::function<BuiltTree(ThreadPool&, CancelToken&)>;
  explicit DeferredTree(Build build) : build_(std::move(build)) {}

  // Lives as long as this does. Throws what the building throws, and Cancelled by the asker's own token alone.
  const Blas& get(ThreadPool& pool, CancelToken& cancel);
  [[nodiscard]] BuiltTree if_built() const;

 private:
  void run(TaskGroup& group, ThreadPool& pool, CancelToken& cancel);

  const Build build_;
  mutable std::mutex mutex_;  // held briefly
  BuiltTree built_;
  std::shared_ptr<TaskGroup> building_;  // null unless a build is under way
};

// What rays are traced through: the tree that came later, if there is one by now.
// It lives as long as `blas`.
[[nodiscard]] inline const Blas& newest_of(const Blas& blas) {
  if (!blas.deferred) return blas;
  const BuiltTree built = blas.deferred->if_built();
  return built.blas ? *built.blas : blas;
}

}  // namespace perfect_bvh
