#include "core/thread_pool.h"

#if defined(__unix__) || defined(__APPLE__)
#include <pthread.h>
#endif

#include <algorithm>
#include <chrono>
#include <memory>
#include <system_error>
#include <utility>

#include "core/errors.h"
#include "core/processors.h"

namespace perfect_bvh {
namespace {

// The group whose task this thread is running.
thread_local TaskGroup* current_group = nullptr;

// Makes a group current while one of its tasks runs.
class CurrentGroup {
 public:
  explicit CurrentGroup(TaskGroup* group) noexcept : previous_(std::exchange(current_group, group)) {}
  ~CurrentGroup() { current_group = previous_; }
  CurrentGroup(const CurrentGroup&) = delete;
  CurrentGroup& operator=(const CurrentGroup&) = delete;

 private:
  TaskGroup* previous_;
};

struct SharedPool {
  std::mutex mutex;
  ThreadPool* pool = nullptr;
  int wanted_thread_count = 0;
  // Replaced pools, whose threads have ended: an operation that began on one may still refer to it.
  std::vector<std::unique_ptr<ThreadPool>> retired;

  // Retires the pool, if there is one. The caller holds the lock, and then joins the threads without it.
  [[nodiscard]] ThreadPool* retire() {
    if (pool != nullptr) retired.emplace_back(pool);
    return std::exchange(pool, nullptr);
  }
};

// After a fork, only the calling thread exists: the child's copy of the pool has no workers, and its mutex may stay
// locked forever. So the child abandons the pool and leaks it, because nothing in it can be destroyed safely. Windows
// has no fork; a process that ends there stops its threads anywhere, which the pool also survives.
SharedPool& shared_state() {
  static SharedPool* const state = [] {
    auto* made = new SharedPool;  // lives as long as the process: workers may outlast static destructors
#if defined(__unix__) || defined(__APPLE__)
    pthread_atfork([] { shared_state().mutex.lock(); }, [] { shared_state().mutex.unlock(); },
                   [] {
                     shared_state().pool = nullptr;
                     shared_state().mutex.unlock();
                   });
#endif
    return made;
  }();
  return *state;
}

}  // namespace

// Pool ------------------------------------------------------------------------------------------------------------

ThreadPool::ThreadPool(int thread_count) {
  const int total = thread_count > 0 ? thread_count : usable_processor_count();
  try {
    workers_.reserve(static_cast<std::size_t>(total - 1));
    for (int i = 1; i < total; ++i) workers_.emplace_back([this] { work(); });
  } catch (const std::system_error&) {
    // The system started no more threads: the existing ones and the caller do the work.
  } catch (...) {
    join_workers();
    throw;
  }
}

ThreadPool::~ThreadPool() { join_workers(); }

void ThreadPool::join_workers() noexcept {
  {
    const std::lock_guard lock(mutex_);
    closing_ = true;
  }
  wake_workers_.notify_all();
  for (auto& worker : workers_) worker.join();
}

ThreadPool& ThreadPool::shared() {
  auto& state = shared_state();
  const std::lock_guard lock(state.mutex);
  if (state.pool == nullptr) state.pool = new ThreadPool(state.wanted_thread_count);
  return *state.pool;
}

void ThreadPool::shutdown_shared() {
  auto& state = shared_state();
  ThreadPool* old = nullptr;
  {
    const std::lock_guard lock(state.mutex);
    old = state.retire();
  }
  if (old != nullptr) old->join_workers();  // outside the lock: the awaited task may use the shared pool
}

void ThreadPool::set_shared_thread_count(int thread_count) {
  auto& state = shared_state();
  ThreadPool* old = nullptr;
  {
    const std::lock_guard lock(state.mutex);
    state.wanted_thread_count = thread_count;
    old = state.retire();
  }
  if (old != nullptr) old->join_workers();
}

void ThreadPool::push(Task task) {
  {
    const std::lock_guard lock(mutex_);
    queue_.push_back(std::move(task));
    if (waiter_count_ > 0) wake_waiters_.notify_all();
  }
  wake_workers_.notify_one();
}

void ThreadPool::run(Task& task) noexcept {
  TaskGroup& group = *task.group;
  ThreadPool& pool = group.pool_;
  group.run_here(task.work);
  task.work = {};  // destroys the task's captures before the group can end
  // Once the count is 0, the waiter may destroy the group: from here on, only the pool is used.
  if (group.pending_.fetch_sub(1, std::memory_order_acq_rel) == 1) pool.tell_waiters();
}

void ThreadPool::tell_waiters() {
  // The lock orders this after a waiter's check of the count: it either saw 0 or is asleep now.
  const std::lock_guard lock(mutex_);
  if (waiter_count_ > 0) wake_waiters_.notify_all();
}

void ThreadPool::work() {
  for (;;) {
    Task task;
    {
      std::unique_lock lock(mutex_);
      wake_workers_.wait(lock, [this] { return closing_ || !queue_.empty(); });
      if (queue_.empty()) return;
      task = std::move(queue_.front());  // oldest first: the largest tasks of a recursive job
      queue_.pop_front();
    }
    run(task);
  }
}

bool ThreadPool::take(const TaskGroup& group, Task& task) {
  for (auto place = queue_.rbegin(); place != queue_.rend(); ++place) {
    const TaskGroup* ancestor = place->group;
    while (ancestor != nullptr && ancestor != &group) ancestor = ancestor->parent_;
    if (ancestor == nullptr) continue;
    task = std::move(*place);
    queue_.erase(std::next(place).base());
    return true;
  }
  return false;
}

void ThreadPool::help(TaskGroup& group, const std::function<void()>& idle) {
  const auto ended = [&group] { return group.pending_.load(std::memory_order_acquire) == 0; };
  while (!ended()) {
    if (idle) idle();
    Task task;
    {
      std::unique_lock lock(mutex_);
      ++waiter_count_;
      const auto has_news = [&] { return ended() || take(group, task); };
      if (idle) {
        wake_waiters_.wait_for(lock, std::chrono::milliseconds(10), has_news);
      } else {
        wake_waiters_.wait(lock, has_news);
      }
      --waiter_count_;
    }
    if (task.group != nullptr) run(task);
  }
}

// Group -----------------------------------------------------------------------------------------------------------

TaskGroup::TaskGroup(ThreadPool& pool) noexcept : pool_(pool), parent_(current_group) {}

TaskGroup::~TaskGroup() { pool_.help(*this, {}); }

void TaskGroup::run(std::function<void()> task) {
  pending_.fetch_add(1, std::memory_order_relaxed);
  try {
    pool_.push({std::move(task), this});
  } catch (...) {
    // Tasks are added by the waiting thread or by a pending task, so no thread can have seen only this count.
    pending_.fetch_sub(1, std::memory_order_relaxed);
    throw;
  }
}

void TaskGroup::run_here(const std::function<void()>& task) noexcept {
  const CurrentGroup current(this);
  try {
    task();
  } catch (const Cancelled&) {
    keep(std::current_exception(), true);
  } catch (...) {
    keep(std::current_exception(), false);
  }
}

void TaskGroup::keep(std::exception_ptr error, bool is_echo) noexcept {
  const std::lock_guard lock(error_mutex_);
  if (error_ && !(error_is_echo_ && !is_echo)) return;
  error_ = std::move(error);
  error_is_echo_ = is_echo;
}

void TaskGroup::wait(const std::function<void()>& idle) {
  try {
    pool_.help(*this, idle);
  } catch (...) {  // idle threw (Ctrl-C): the tasks refer to our caller's stack, so they must end first
    pool_.help(*this, {});
    error_ = nullptr;
    throw;
  }
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

// Loop ------------------------------------------------------------------------------------------------------------

void parallel_for(ThreadPool& pool, std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t, std::size_t)>& body, int max_threads,
                  const std::function<void()>& idle) {
  if (count == 0) return;
  grain = std::max<std::size_t>(grain, 1);
  const std::size_t chunk_count = (count - 1) / grain + 1;
  const auto pool_size = static_cast<std::size_t>(pool.thread_count());
  const std::size_t limit = max_threads > 0 ? static_cast<std::size_t>(max_threads) : pool_size;
  const std::size_t thread_count = std::min({chunk_count, limit, pool_size});

  std::atomic<std::size_t> next{0};
  const auto run_chunks = [&](const std::function<void()>& between) {
    try {
      for (;;) {
        const std::size_t chunk = next.fetch_add(1, std::memory_order_relaxed);
        if (chunk >= chunk_count) return;
        body(chunk * grain, std::min(count, (chunk + 1) * grain));
        if (between) between();
      }
    } catch (...) {
      next.store(chunk_count, std::memory_order_relaxed);  // no new chunk starts
      throw;
    }
  };
  if (thread_count <= 1) return run_chunks(idle);

  TaskGroup group(pool);
  for (std::size_t i = 1; i < thread_count; ++i) group.run([&] { run_chunks({}); });
  group.run_here([&] { run_chunks(idle); });
  group.wait(idle);
}

}  // namespace perfect_bvh
