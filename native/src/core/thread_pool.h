// A small thread pool: parallel loops and nested task groups over std::thread.
// In: callables. Out: their first exception, rethrown in the thread that waits. The waiting thread works too, so
// nesting never deadlocks. Sized from the CPU affinity; made anew in a forked child; no library that Blender loads.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

namespace perfect_bvh {

class ThreadPool {
 public:
  // thread_count includes the calling thread: 1 means no worker at all. 0: as many as the affinity mask allows.
  explicit ThreadPool(int thread_count = 0);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  [[nodiscard]] int thread_count() const noexcept { return static_cast<int>(workers_.size()) + 1; }

  // The process's pool, created at first use and again in a child after fork.
  [[nodiscard]] static ThreadPool& shared();
  // Joins the shared pool's workers; the next use makes a new one. Call with no parallel work under way.
  static void shutdown_shared();
  // The size the next shared pool gets (0: from the affinity); replaces the present one.
  static void set_shared_thread_count(int thread_count);

 private:
  friend class TaskGroup;
  using Task = std::function<void()>;

  void push(Task task);
  bool run_one();  // runs a queued task on the calling thread; false if there was none
  void work();

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Task> queue_;
  bool closing_ = false;
  std::vector<std::thread> workers_;
};

// Tasks that are waited for together. Tasks may make groups of their own.
class TaskGroup {
 public:
  explicit TaskGroup(ThreadPool& pool) : pool_(pool) {}
  ~TaskGroup();  // waits; an exception that nobody asked for with wait() is dropped
  TaskGroup(const TaskGroup&) = delete;
  TaskGroup& operator=(const TaskGroup&) = delete;

  void run(std::function<void()> task);
  // Helps until every task has ended, then rethrows the first exception. `idle` runs between tasks on this thread.
  void wait(const std::function<void()>& idle = {});

 private:
  void finish_all(const std::function<void()>& idle);

  ThreadPool& pool_;
  std::mutex mutex_;
  std::condition_variable finished_;
  std::size_t pending_ = 0;
  std::exception_ptr error_;
};

// Calls body(begin, end) for consecutive chunks of at most `grain` of [0, count). Chunks are handed out in order to
// at most `max_threads` threads (0: all of the pool's). The chunk borders depend on count and grain alone. After an
// exception no new chunk starts. `idle` runs on the calling thread between its chunks (progress, Ctrl-C).
void parallel_for(ThreadPool& pool, std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body, int max_threads = 0,
                  const std::function<void()>& idle = {});

}  // namespace perfect_bvh
