#include "core/thread_pool.h"

#include <pthread.h>
#include <sched.h>

#include <algorithm>

namespace perfect_bvh {
namespace {

int affinity_thread_count() {
#ifdef __linux__
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof(set), &set) == 0) return std::max(1, CPU_COUNT(&set));
#endif
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

// After fork only the calling thread lives on: the child's copy of the pool has no workers and its mutex may be
// locked for ever. The child therefore forgets the pool (leaks it: nothing in it can be destroyed safely).
struct SharedPool {
  std::mutex mutex;
  ThreadPool* pool = nullptr;
  int wanted_thread_count = 0;
};

SharedPool& shared_state() {
  static SharedPool* const state = [] {
    auto* made = new SharedPool;  // lives as long as the process: workers may outlast static destructors
    pthread_atfork([] { shared_state().mutex.lock(); }, [] { shared_state().mutex.unlock(); },
                   [] {
                     shared_state().pool = nullptr;
                     shared_state().mutex.unlock();
                   });
    return made;
  }();
  return *state;
}

}  // namespace

ThreadPool::ThreadPool(int thread_count) {
  const int total = thread_count > 0 ? thread_count : affinity_thread_count();
  workers_.reserve(static_cast<std::size_t>(total - 1));
  for (int i = 1; i < total; ++i) workers_.emplace_back([this] { work(); });
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard lock(mutex_);
    closing_ = true;
  }
  wake_.notify_all();
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
  const std::lock_guard lock(state.mutex);
  delete state.pool;
  state.pool = nullptr;
}

void ThreadPool::set_shared_thread_count(int thread_count) {
  shutdown_shared();
  auto& state = shared_state();
  const std::lock_guard lock(state.mutex);
  state.wanted_thread_count = thread_count;
}

void ThreadPool::push(Task task) {
  {
    const std::lock_guard lock(mutex_);
    queue_.push_back(std::move(task));
  }
  wake_.notify_one();
}

bool ThreadPool::run_one() {
  Task task;
  {
    const std::lock_guard lock(mutex_);
    if (queue_.empty()) return false;
    // Newest first: a waiting thread most likely finds its own group's tasks, with their data still in cache.
    task = std::move(queue_.back());
    queue_.pop_back();
  }
  task();
  return true;
}

void ThreadPool::work() {
  for (;;) {
    Task task;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [this] { return closing_ || !queue_.empty(); });
      if (queue_.empty()) return;
      task = std::move(queue_.front());
      queue_.pop_front();
    }
    task();
  }
}

TaskGroup::~TaskGroup() { finish_all({}); }

void TaskGroup::run(std::function<void()> task) {
  {
    const std::lock_guard lock(mutex_);
    ++pending_;
  }
  auto guarded = [this, task = std::move(task)] {
    std::exception_ptr error;
    try {
      task();
    } catch (...) {
      error = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    if (error && !error_) error_ = error;
    // Notified under the lock: once it is released the waiter may destroy this group.
    if (--pending_ == 0) finished_.notify_all();
  };
  try {
    pool_.push(std::move(guarded));
  } catch (...) {
    const std::lock_guard lock(mutex_);
    --pending_;
    throw;
  }
}

void TaskGroup::finish_all(const std::function<void()>& idle) {
  for (;;) {
    {
      const std::lock_guard lock(mutex_);
      if (pending_ == 0) return;
    }
    if (idle) idle();
    if (pool_.run_one()) continue;
    std::unique_lock lock(mutex_);
    if (pending_ == 0) return;
    // The last tasks run elsewhere; wake now and then to help with what they may have queued.
    finished_.wait_for(lock, std::chrono::milliseconds(idle ? 10 : 1));
  }
}

void TaskGroup::wait(const std::function<void()>& idle) {
  try {
    finish_all(idle);
  } catch (...) {  // idle threw (Ctrl-C): the tasks refer to our caller's stack, so they must end first
    finish_all({});
    throw;
  }
  std::exception_ptr error;
  {
    const std::lock_guard lock(mutex_);
    std::swap(error, error_);
  }
  if (error) std::rethrow_exception(error);
}

void parallel_for(ThreadPool& pool, std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t, std::size_t)>& body, int max_threads,
                  const std::function<void()>& idle) {
  if (count == 0) return;
  grain = std::max<std::size_t>(grain, 1);
  const std::size_t chunk_count = (count + grain - 1) / grain;
  const std::size_t limit = max_threads > 0 ? static_cast<std::size_t>(max_threads) : static_cast<std::size_t>(pool.thread_count());
  const std::size_t thread_count = std::min({chunk_count, limit, static_cast<std::size_t>(pool.thread_count())});

  std::atomic<std::size_t> next{0};
  std::atomic<bool> failed{false};
  const auto run_chunks = [&](bool is_caller) {
    try {
      for (;;) {
        const std::size_t chunk = next.fetch_add(1, std::memory_order_relaxed);
        if (chunk >= chunk_count || failed.load(std::memory_order_relaxed)) return;
        body(chunk * grain, std::min(count, (chunk + 1) * grain));
        if (is_caller && idle) idle();
      }
    } catch (...) {
      failed.store(true, std::memory_order_relaxed);
      throw;
    }
  };

  TaskGroup group(pool);
  try {
    for (std::size_t i = 1; i < thread_count; ++i) group.run([&] { run_chunks(false); });
    run_chunks(true);
  } catch (...) {
    failed.store(true, std::memory_order_relaxed);
    throw;  // ~TaskGroup waits for the others
  }
  group.wait(idle);
}

}  // namespace perfect_bvh
