#include "blas/deferred_tree.h"

namespace perfect_bvh {

BuiltTree DeferredTree::if_built() const {
  const std::lock_guard lock(mutex_);
  return built_;
}

// The caller holds the lock. The group has its task before anybody else can see it.
void DeferredTree::run(TaskGroup& group, ThreadPool& pool, CancelToken& cancel) {
  group.run([this, &pool, &cancel] {
    BuiltTree tree;
    try {
      tree = build_(pool, cancel);
    } catch (...) {
      const std::lock_guard lock(mutex_);
      building_.reset();
      throw;
    }
    const std::lock_guard lock(mutex_);
    built_ = std::move(tree);
    building_.reset();
  });
}

const Blas& DeferredTree::get(ThreadPool& pool, CancelToken& cancel) {
  for (;;) {
    cancel.checkpoint();
    // The progress of the caller's work is not that of the build; only a stop reaches it.
    CancelToken stop_with_caller([&](float) {
      cancel.poll();
      return !cancel.stop_requested();
    });
    std::shared_ptr<TaskGroup> others, mine;
    {
      const std::lock_guard lock(mutex_);
      if (built_.blas) return *built_.blas;
      others = building_;
      if (!others) {
        mine = std::make_shared<TaskGroup>(pool);
        run(*mine, pool, stop_with_caller);
        building_ = mine;
      }
    }
    if (mine) {
      mine->wait([&] { stop_with_caller.checkpoint(); });
    } else {
      others->help([&] { cancel.checkpoint(); });  // if they fail, it is this thread's turn
    }
  }
}

}  // namespace perfect_bvh
