// Measures how long a stage took, by the wall clock. Used for reports, never for decisions.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <exception>
#include <functional>
#include <thread>
#include <utility>

#include "core/errors.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

class Stopwatch {
 public:
  [[nodiscard]] double milliseconds() const {
    return std::chrono::duration<double, std::milli>(Clock::now() - start_).count();
  }
  // Returns the time since the last lap, or the beginning.
  double lap_milliseconds() {
    const Clock::time_point now = Clock::now();
    const double lap = std::chrono::duration<double, std::milli>(now - lap_start_).count();
    lap_start_ = now;
    return lap;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now(), lap_start_ = start_;
};

// Cancel --------------------------------------------------------------------------------------------------------------
// Reports the progress of a long operation, and stops it on request.
// In: any thread reports work done. The owner's callback runs only on the thread that made the token (it may hold
// Python's lock). Out: `Cancelled` is thrown on every thread that polls after a stop was requested.

class CancelToken {
 public:
  // callback(fraction 0..1) returns false to cancel. It may throw: the exception reaches the caller of poll().
  using Callback = std::function<bool(float)>;

  CancelToken() = default;
  // The callback is called at most once per interval.
  explicit CancelToken(Callback callback, std::chrono::milliseconds interval = std::chrono::milliseconds(50))
      : callback_(std::move(callback)), interval_(interval) {}
  CancelToken(const CancelToken&) = delete;
  CancelToken& operator=(const CancelToken&) = delete;

  void request_stop() noexcept { stop_.store(true, std::memory_order_relaxed); }
  [[nodiscard]] bool stop_requested() const noexcept {
    return stop_.load(std::memory_order_relaxed) || (followed_ && followed_->load(std::memory_order_relaxed));
  }
  // Also stops when `flag` is set; the setter needs no token. The flag must outlive the token.
  void follow(const std::atomic<bool>& flag) noexcept { followed_ = &flag; }
  void throw_if_stopped() const {
    if (stop_requested()) throw Cancelled();
  }

  // Work is counted in units of the owner's choice: `expect(total)` once, `advance(done)` from any thread.
  void expect(std::size_t total) noexcept {
    total_.store(total, std::memory_order_relaxed);
    done_.store(0, std::memory_order_relaxed);
  }
  void advance(std::size_t done) noexcept { done_.fetch_add(done, std::memory_order_relaxed); }
  // Returns at most 1, even if more work is done than announced.
  [[nodiscard]] float fraction() const noexcept {
    const auto total = total_.load(std::memory_order_relaxed);
    const auto done = done_.load(std::memory_order_relaxed);
    if (total == 0) return 0.0f;
    return done >= total ? 1.0f : static_cast<float>(done) / static_cast<float>(total);
  }

  // Returns whether ask() would call the callback.
  [[nodiscard]] bool is_due() const noexcept {
    if (!callback_ || std::this_thread::get_id() != owner_ || stop_requested()) return false;
    return std::chrono::steady_clock::now() - last_poll_ >= interval_;
  }

  // Calls the callback if its interval has passed. Does not call it on other threads than the owner's, so that work
  // divided among threads may call it on any of them. Returns true if the work should stop; the callback's exception is
  // kept for rethrow_callback_error().
  bool ask() noexcept {
    if (!is_due()) return stop_requested();
    try {
      if (!callback_(fraction())) request_stop();
    } catch (...) {
      callback_error_ = std::current_exception();
      request_stop();
    }
    last_poll_ = std::chrono::steady_clock::now();  // a slow callback must not take all the time
    return stop_requested();
  }

  // The same, but throws the callback's exception.
  void poll() {
    if (is_due() && ask()) rethrow_callback_error();
  }

  // Called every millisecond or so of work: lets the owner's callback run, and throws if a stop was requested.
  void checkpoint() {
    poll();
    throw_if_stopped();
  }

  // Another thread's Cancelled may arrive before the callback's exception: code that catches Cancelled calls this
  // first.
  void rethrow_callback_error() const {
    if (callback_error_) std::rethrow_exception(callback_error_);
  }

 private:
  std::atomic<bool> stop_{false};
  const std::atomic<bool>* followed_ = nullptr;
  std::atomic<std::size_t> total_{0};
  std::atomic<std::size_t> done_{0};
  Callback callback_;
  std::chrono::milliseconds interval_{};
  std::exception_ptr callback_error_;
  std::thread::id owner_{std::this_thread::get_id()};
  std::chrono::steady_clock::time_point last_poll_{std::chrono::steady_clock::now()};
};

// Steps ---------------------------------------------------------------------------------------------------------------
// Loops over all primitives or nodes that check for cancellation (core/cancel.h) at a fixed number of items, so that
// the time between two checks is bounded for data of any size. On threads other than the token's owner, a check only
// detects a stop; the owner runs the callback while it waits for them.

// A check costs as much as about ten items.
inline constexpr std::size_t kItemsBetweenAsking = 16384;

// Returns the number of chunks of this size into which for_chunks() divides the items.
[[nodiscard]] constexpr std::size_t chunk_count_of(std::size_t item_count) noexcept {
  return (item_count + kItemsBetweenAsking - 1) / kItemsBetweenAsking;
}

// Calls body(begin, end) on this thread for consecutive parts of [0, count), at least one. If there is only one part,
// there is no check.
template <class Body>
void for_steps(std::size_t count, CancelToken& cancel, const Body& body) {
  for (std::size_t begin = 0;;) {
    const std::size_t end = std::min(count, begin + kItemsBetweenAsking);
    body(begin, end);
    if (end == count) return;
    cancel.checkpoint();
    begin = end;
  }
}

// The same, from the last part to the first.
template <class Body>
void for_steps_back(std::size_t count, CancelToken& cancel, const Body& body) {
  for (std::size_t end = count;;) {
    const std::size_t begin = end - std::min(end, kItemsBetweenAsking);
    body(begin, end);
    if (begin == 0) return;
    cancel.checkpoint();
    end = begin;
  }
}

// Does parallel_for on the pool's threads, with a check before each chunk, and while the caller waits for the others.
template <class Body>
void for_chunks(ThreadPool& pool, std::size_t count, std::size_t grain, CancelToken& cancel, const Body& body) {
  const auto run = [&](std::size_t begin, std::size_t end) {
    cancel.checkpoint();
    body(begin, end);
  };
  parallel_for(pool, count, grain, run, 0, [&] { cancel.checkpoint(); });
}

// For loops with an unknown number of items.
class Steps {
 public:
  explicit Steps(CancelToken& cancel) noexcept : cancel_(cancel) {}

  // Call before each item.
  void step() {
    if (--left_ == 0) ask();
  }

 private:
  [[gnu::noinline]] void ask() {
    left_ = kItemsBetweenAsking;
    cancel_.checkpoint();
  }

  CancelToken& cancel_;
  std::size_t left_ = kItemsBetweenAsking;
};

}  // namespace perfect_bvh
