// Threads and cancelling: loops, nesting, exceptions, and that no caller waits for another caller's work.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <latch>
#include <memory>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh::test {
namespace {

std::uint64_t count_leaves(ThreadPool& pool, int depth) {
  if (depth == 0) return 1;
  std::array<std::uint64_t, 2> counts{};
  TaskGroup group(pool);
  group.run([&] { counts[0] = count_leaves(pool, depth - 1); });
  group.run([&] { counts[1] = count_leaves(pool, depth - 1); });
  group.wait();
  return counts[0] + counts[1];
}

class Pools : public testing::TestWithParam<int> {
 protected:
  ThreadPool pool{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Sizes, Pools, testing::Values(1, 2, 4, 16));

TEST_P(Pools, LoopsCoverEachIndexOnceInTheSameChunks) {
  for (const std::size_t count : {0u, 1u, 7u, 100u, 10007u}) {
    for (const std::size_t grain : {0u, 1u, 10u, 100000u}) {
      std::vector<std::atomic<int>> seen(count);
      parallel_for(pool, count, grain, [&](std::size_t begin, std::size_t end) {
        EXPECT_LT(begin, end);
        EXPECT_EQ(begin % std::max<std::size_t>(grain, 1), 0u);
        EXPECT_LE(end - begin, std::max<std::size_t>(grain, 1));
        for (std::size_t i = begin; i < end; ++i) ++seen[i];
      });
      for (const auto& times : seen) ASSERT_EQ(times, 1);
    }
  }
}

TEST_P(Pools, UseNoMoreThreadsThanAllowed) {
  for (const int limit : {1, 2, 3}) {
    std::mutex mutex;
    std::set<std::thread::id> ids;
    parallel_for(
        pool, 200, 1,
        [&](std::size_t, std::size_t) {
          const std::lock_guard lock(mutex);
          ids.insert(std::this_thread::get_id());
        },
        limit);
    EXPECT_LE(ids.size(), static_cast<std::size_t>(limit));
  }
}

TEST_P(Pools, NestGroupsInGroups) { EXPECT_EQ(count_leaves(pool, 10), 1024u); }

TEST_P(Pools, NestLoopsInLoops) {
  std::atomic<int> total{0};
  parallel_for(pool, 20, 1, [&](std::size_t, std::size_t) {
    parallel_for(pool, 20, 1, [&](std::size_t, std::size_t) {
      parallel_for(pool, 5, 2, [&](std::size_t begin, std::size_t end) { total += static_cast<int>(end - begin); });
    });
  });
  EXPECT_EQ(total, 2000);
}

TEST_P(Pools, LetTasksAddTasksToTheirGroup) {
  std::atomic<int> total{0};
  TaskGroup group(pool);
  std::function<void(int)> spawn = [&](int depth) {
    ++total;
    for (int i = 0; i < 2 && depth > 0; ++i) group.run([&, depth] { spawn(depth - 1); });
  };
  group.run([&] { spawn(9); });
  group.wait();
  EXPECT_EQ(total, 1023);
  group.run([&] { total = -1; });  // a group can be used again
  group.wait();
  EXPECT_EQ(total, -1);
}

TEST_P(Pools, RethrowWhereTheWaitIs) {
  TaskGroup group(pool);
  std::atomic<int> ended{0};
  for (int i = 0; i < 20; ++i) {
    group.run([&, i] {
      if (i == 7) throw std::runtime_error("seven");
      ++ended;
    });
  }
  EXPECT_THROW(group.wait(), std::runtime_error);
  EXPECT_EQ(ended, 19);
  group.wait();  // it throws only once
}

TEST_P(Pools, ReportTheCauseNotItsEcho) {
  for (int round = 0; round < 20; ++round) {
    TaskGroup group(pool);
    CancelToken cancel;
    for (int i = 0; i < 8; ++i) {
      group.run([&, i] {
        if (i == 5) {
          cancel.request_stop();
          throw std::domain_error("the cause");
        }
        cancel.throw_if_stopped();
      });
    }
    EXPECT_THROW(group.wait(), std::domain_error);
  }
}

TEST_P(Pools, StartNoChunkAfterAnException) {
  constexpr std::size_t kChunks = 1'000'000;  // so many that no other thread finishes before the first one fails
  std::atomic<std::size_t> started{0};
  std::atomic<bool> fails{false};
  const auto body = [&](std::size_t begin, std::size_t) {
    ++started;
    if (begin == 0) {
      fails = true;
      throw std::runtime_error("first chunk");
    }
    while (!fails) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  };
  EXPECT_THROW(parallel_for(pool, kChunks, 1, body), std::runtime_error);
  EXPECT_LT(started, kChunks);
}

TEST_P(Pools, CarryExceptionsThroughNestedLoops) {
  const auto inner = [&](std::size_t begin, std::size_t) {
    if (begin == 13) throw std::out_of_range("deep");
  };
  const auto outer = [&](std::size_t, std::size_t) { parallel_for(pool, 20, 1, inner); };
  EXPECT_THROW(parallel_for(pool, 4, 1, outer), std::out_of_range);
}

TEST_P(Pools, FinishTheTasksWhenIdleThrows) {
  std::atomic<int> ended{0};
  std::atomic<bool> interrupted{false};
  TaskGroup group(pool);
  for (int i = 0; i < 50; ++i) {
    group.run([&] {
      while (!interrupted) std::this_thread::yield();
      ++ended;
    });
  }
  const auto interrupt = [&] {
    interrupted = true;
    throw std::runtime_error("Ctrl-C");
  };
  EXPECT_THROW(group.wait(interrupt), std::runtime_error);
  EXPECT_EQ(ended, 50);
}

TEST_P(Pools, CallIdleOnTheCallingThreadOnly) {
  const auto caller = std::this_thread::get_id();
  std::atomic<int> calls{0};
  // Workers wait for the first call, so that they cannot take all chunks before the caller has one.
  const auto last = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  const auto work = [&](std::size_t, std::size_t) {
    while (std::this_thread::get_id() != caller && calls == 0 && std::chrono::steady_clock::now() < last) {
      std::this_thread::yield();
    }
  };
  parallel_for(pool, 64, 1, work, 0, [&] {
    EXPECT_EQ(std::this_thread::get_id(), caller);
    ++calls;
  });
  EXPECT_GT(calls, 0);
}

TEST_P(Pools, ServeSeveralCallersAtOnce) {
  std::vector<std::thread> callers;
  std::atomic<std::uint64_t> total{0};
  for (int i = 0; i < 6; ++i) {
    callers.emplace_back([&] {
      for (int round = 0; round < 20; ++round) {
        parallel_for(pool, 1000, 7, [&](std::size_t begin, std::size_t end) { total += end - begin; });
        total += count_leaves(pool, 4);
      }
    });
  }
  for (auto& caller : callers) caller.join();
  EXPECT_EQ(total, 6u * 20u * 1016u);
}

TEST(ThreadPoolTest, KeepsAShortJobFromGettingStuckBehindAnothersLongOne) {
  ThreadPool pool(1);  // no workers: the waiting thread does the work
  TaskGroup long_job(pool);
  bool long_ran = false;
  long_job.run([&] { long_ran = true; });
  TaskGroup short_job(pool);
  bool short_ran = false;
  short_job.run([&] { short_ran = true; });
  std::thread waiter([&] { short_job.wait(); });
  waiter.join();
  EXPECT_TRUE(short_ran);
  EXPECT_FALSE(long_ran);
  long_job.wait();
  EXPECT_TRUE(long_ran);
}

TEST(ThreadPoolTest, RunsTasksOnAllItsThreads) {
  ThreadPool pool(3);
  ASSERT_EQ(pool.thread_count(), 3);
  std::latch all_here(3);  // passes only if three threads run at the same time
  TaskGroup group(pool);
  for (int i = 0; i < 3; ++i) group.run([&] { all_here.arrive_and_wait(); });
  group.wait();
}

TEST(ThreadPoolTest, DestroysWhatATaskCapturedBeforeTheWaitEnds) {
  ThreadPool pool(4);
  for (int round = 0; round < 200; ++round) {
    const auto captured = std::make_shared<int>(0);
    TaskGroup group(pool);
    for (int i = 0; i < 4; ++i) group.run([captured] { (void)*captured; });
    group.wait();
    ASSERT_EQ(captured.use_count(), 1);
  }
}

TEST(SharedPool, IsOneAndCanBeResized) {
  ThreadPool::set_shared_thread_count(3);
  EXPECT_EQ(ThreadPool::shared().thread_count(), 3);
  EXPECT_EQ(&ThreadPool::shared(), &ThreadPool::shared());
  ThreadPool::shutdown_shared();
  ThreadPool::shutdown_shared();  // a second call does nothing
  EXPECT_EQ(ThreadPool::shared().thread_count(), 3);
  ThreadPool::set_shared_thread_count(0);
  EXPECT_GE(ThreadPool::shared().thread_count(), 1);
}

TEST(SharedPool, IsReplacedUnderWork) {
  ThreadPool::set_shared_thread_count(3);
  std::atomic<bool> enough{false};
  std::atomic<int> right{0}, wrong{0};
  std::thread busy([&] {
    while (!enough) {
      ThreadPool& pool = ThreadPool::shared();
      for (int i = 0; i < 5; ++i) {  // continues after the pool was replaced
        std::atomic<std::size_t> total{0};
        parallel_for(pool, 1000, 1, [&](std::size_t begin, std::size_t) { total += begin; });
        ++(total == 499500 ? right : wrong);
      }
    }
  });
  for (int i = 0; i < 50; ++i) {
    i % 2 == 0 ? ThreadPool::shutdown_shared() : ThreadPool::set_shared_thread_count(2 + i % 3);
    std::this_thread::yield();
  }
  while (right + wrong < 10) std::this_thread::yield();
  enough = true;
  busy.join();
  EXPECT_GT(right, 0);
  EXPECT_EQ(wrong, 0);
  ThreadPool::set_shared_thread_count(0);
}

TEST(Cancel, TellsFractionsAndNeverMoreThanOne) {
  CancelToken cancel;
  EXPECT_EQ(cancel.fraction(), 0.0f);
  cancel.expect(10);
  cancel.advance(4);
  EXPECT_FLOAT_EQ(cancel.fraction(), 0.4f);
  cancel.advance(100);
  EXPECT_EQ(cancel.fraction(), 1.0f);
}

TEST(Cancel, StopsWhenTheCallbackSaysSo) {
  int calls = 0;
  CancelToken cancel([&](float) { return ++calls < 2; });
  const auto poll_until_stopped = [&] {
    for (int i = 0; i < 1000; ++i) {
      cancel.checkpoint();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  };
  EXPECT_THROW(poll_until_stopped(), Cancelled);
  EXPECT_EQ(calls, 2) << "asked every 50 ms, and no more after it refused";
}

TEST(Cancel, PassesTheCallbacksExceptionOnAndStops) {
  CancelToken cancel([](float) -> bool { throw std::domain_error("KeyboardInterrupt"); });
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  EXPECT_THROW(cancel.checkpoint(), std::domain_error);
  EXPECT_THROW(cancel.checkpoint(), Cancelled);
}

TEST(Cancel, CallsBackOnItsOwnersThreadOnly) {
  int calls = 0;
  CancelToken cancel([&](float) { return ++calls > 0; });
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  std::thread([&] { cancel.checkpoint(); }).join();
  EXPECT_EQ(calls, 0);
  cancel.checkpoint();
  EXPECT_EQ(calls, 1);
}

TEST(Cancel, StopsOnEveryThreadAsSoonAsAFlagThatItFollowsIsSet) {
  std::atomic<bool> flag{false};
  int calls = 0;
  CancelToken cancel([&](float) { return ++calls > 0; });
  cancel.follow(flag);
  cancel.checkpoint();
  EXPECT_FALSE(cancel.stop_requested());
  flag = true;
  std::thread([&] { EXPECT_THROW(cancel.throw_if_stopped(), Cancelled); }).join();
  EXPECT_THROW(cancel.checkpoint(), Cancelled);
  EXPECT_EQ(calls, 0) << "no progress callable had to be called";
}

}  // namespace
}  // namespace perfect_bvh::test
