// How a long operation tells its progress and learns that it should stop.
// In: any thread reports work done; the owner's callback runs on the calling thread only (it may hold Python's
// lock). Out: `Cancelled` is thrown on every thread that asks after a stop was requested.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>

#include "core/errors.h"

namespace perfect_bvh {

class CancelToken {
 public:
  // callback(fraction 0..1) -> false to cancel. It may throw: the exception reaches the caller of poll().
  using Callback = std::function<bool(float)>;

  CancelToken() = default;
  explicit CancelToken(Callback callback) : callback_(std::move(callback)) {}
  CancelToken(const CancelToken&) = delete;
  CancelToken& operator=(const CancelToken&) = delete;

  void request_stop() noexcept { stop_.store(true, std::memory_order_relaxed); }
  [[nodiscard]] bool stop_requested() const noexcept { return stop_.load(std::memory_order_relaxed); }
  void throw_if_stopped() const {
    if (stop_requested()) throw Cancelled();
  }

  // Work is counted in units of the owner's choice: `expect(total)` once, `advance(done)` from any thread.
  void expect(std::size_t total) noexcept { total_.store(total, std::memory_order_relaxed), done_.store(0, std::memory_order_relaxed); }
  void advance(std::size_t done) noexcept { done_.fetch_add(done, std::memory_order_relaxed); }
  [[nodiscard]] float fraction() const noexcept {
    const auto total = total_.load(std::memory_order_relaxed);
    return total == 0 ? 0.0f : static_cast<float>(done_.load(std::memory_order_relaxed)) / static_cast<float>(total);
  }

  // Calls the callback at most every 50 ms; only the thread that owns the operation may call this.
  void poll() {
    if (!callback_) return;
    const auto now = std::chrono::steady_clock::now();
    if (now - last_poll_ < std::chrono::milliseconds(50)) return;
    last_poll_ = now;
    bool go_on = false;
    try {
      go_on = callback_(fraction());
    } catch (...) {
      request_stop();
      throw;
    }
    if (!go_on) request_stop();
  }

 private:
  std::atomic<bool> stop_{false};
  std::atomic<std::size_t> total_{0};
  std::atomic<std::size_t> done_{0};
  Callback callback_;
  std::chrono::steady_clock::time_point last_poll_{std::chrono::steady_clock::now()};
};

}  // namespace perfect_bvh
