// The shared pool in a forked child. Not tested on systems without fork.
#if defined(__unix__) || defined(__APPLE__)

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <thread>

#include "core/thread_pool.h"

namespace perfect_bvh::test {
namespace {

#if defined(__SANITIZE_THREAD__)
constexpr bool kForkIsTestable = false;  // the sanitizer refuses threads in a forked child of a threaded process
#else
constexpr bool kForkIsTestable = true;
#endif

// Returns 0 if `body` is true in a forked child, 1 if not; -1 if it hangs (a signal ends it after a minute), -2 if
// there is no child.
template <class Body>
int run_in_child(const Body& body) {
  const pid_t child = fork();
  if (child < 0) return -2;
  if (child == 0) {
    alarm(60);
    _exit(body() ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

bool sums_right(ThreadPool& pool) {
  std::atomic<std::size_t> total{0};
  parallel_for(pool, 1000, 1, [&](std::size_t begin, std::size_t) { total += begin; });
  return total == 499500;
}

TEST(SharedPool, WorksInAForkedChild) {
  if (!kForkIsTestable) GTEST_SKIP() << "not under ThreadSanitizer";
  ThreadPool::set_shared_thread_count(4);
  ASSERT_TRUE(sums_right(ThreadPool::shared()));
  EXPECT_EQ(run_in_child([] { return sums_right(ThreadPool::shared()) && ThreadPool::shared().thread_count() == 4; }),
            0);
  EXPECT_TRUE(sums_right(ThreadPool::shared())) << "the parent's pool lives on";
  ThreadPool::set_shared_thread_count(0);
}

TEST(SharedPool, WorksInAChildForkedWhileOthersAreBusy) {
  if (!kForkIsTestable) GTEST_SKIP() << "not under ThreadSanitizer";
  ThreadPool::set_shared_thread_count(4);
  std::atomic<bool> enough{false};
  std::thread busy([&] {
    while (!enough) (void)sums_right(ThreadPool::shared());
  });
  for (int i = 0; i < 10; ++i) EXPECT_EQ(run_in_child([] { return sums_right(ThreadPool::shared()); }), 0);
  enough = true;
  busy.join();
  ThreadPool::set_shared_thread_count(0);
}

}  // namespace
}  // namespace perfect_bvh::test

#endif
