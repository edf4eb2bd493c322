// A small thread pool: parallel loops and nested task groups over std::thread.
// In: callables. Out: their first exception, rethrown in the waiting thread. The waiting thread works too, but only on
// tasks of the group it waits for and of groups made inside them. So nesting never deadlocks, the C++ stack grows no
// deeper than groups are nested, and a short job never waits for another caller's long one. The size follows the CPU
// affinity. The pool is made again in a forked child, and uses no library that Blender loads.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace perfect_bvh {

class TaskGroup;

class ThreadPool {
 public:
  // thread_count includes the calling thread: 1 means no workers. 0: the size of the affinity mask.
  // If the system cannot start that many threads, the pool works with those it got.
  explicit ThreadPool(int thread_count = 0);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  [[nodiscard]] int thread_count() const noexcept { return static_cast<int>(workers_.size()) + 1; }

  // Returns the process's pool, created on first use and again in a child after fork: call this for every operation.
  // Other pools do not survive a fork.
  [[nodiscard]] static ThreadPool& shared();
  // Joins the shared pool's workers; the next use makes a new one. Running operations on the old one stay valid: the
  // workers finish the queue, and the calling threads do the rest.
  static void shutdown_shared();
  // Sets the size of the next shared pool (0: from the affinity); replaces the present one in the same way.
  static void set_shared_thread_count(int thread_count);

 private:
  friend class TaskGroup;
  struct Task {
    std::function<void()> work;
    TaskGroup* group = nullptr;
  };

  void push(Task task);
  void work();
  static void run(Task& task) noexcept;
  // Runs queued tasks of `group` or of its descendants until none of its tasks is pending. `idle` runs between tasks.
  void help(TaskGroup& group, const std::function<void()>& idle);
  // Takes the newest such task; returns false if there is none. The lock must be held.
  [[nodiscard]] bool take(const TaskGroup& group, Task& task);
  void tell_waiters();
  void join_workers() noexcept;

  std::mutex mutex_;
  std::condition_variable wake_workers_;
  std::condition_variable wake_waiters_;
  std::deque<Task> queue_;
  int waiter_count_ = 0;
  bool closing_ = false;
  std::vector<std::thread> workers_;
};

// Tasks that are waited for together. Tasks may add tasks to their own group and may make further groups.
class TaskGroup {
 public:
  explicit TaskGroup(ThreadPool& pool) noexcept;
  ~TaskGroup();  // waits; drops an exception that no wait() has rethrown
  TaskGroup(const TaskGroup&) = delete;
  TaskGroup& operator=(const TaskGroup&) = delete;

  void run(std::function<void()> task);
  // Runs the task immediately on this thread; its exception is kept for wait(), as for other tasks.
  void run_here(const std::function<void()>& task) noexcept;
  // Works until every task has ended, then rethrows the first exception. Rethrows Cancelled only if there was no other,
  // since it is only a consequence of the one that stopped the operation. `idle` runs between tasks, on this thread; it
  // may throw.
  void wait(const std::function<void()>& idle = {});

 private:
  friend class ThreadPool;
  void keep(std::exception_ptr error, bool is_echo) noexcept;

  ThreadPool& pool_;
  TaskGroup* const parent_;  // the group of the task that made this group: it outlives this one
  std::atomic<std::size_t> pending_{0};
  std::mutex error_mutex_;
  std::exception_ptr error_;
  bool error_is_echo_ = false;
};

// Calls body(begin, end) for consecutive chunks of at most `grain` of [0, count). Chunks are handed out in order to at
// most `max_threads` threads (0: all of the pool's). The chunk borders depend only on count and grain. After an
// exception, no new chunk starts. `idle` runs on the calling thread between its chunks (progress, Ctrl-C).
void parallel_for(ThreadPool& pool, std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body, int max_threads = 0,
                  const std::function<void()>& idle = {});

}  // namespace perfect_bvh
