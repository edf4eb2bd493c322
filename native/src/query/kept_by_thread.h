// Memory that a thread keeps from block to block and from batch to batch: rays and hits of a large block are 0.7 MB,
// which the system would hand out page by page each time.
#pragma once

#include <cstddef>
#include <span>
#include <utility>

#include "core/aligned.h"

namespace perfect_bvh {

// The calling thread's T for as long as this stands. Code that is called meanwhile and wants one as well (a callback
// that casts rays) finds an empty one.
template <class T>
class KeptByThread {
 public:
  KeptByThread() : value_(std::move(kept())) {}
  ~KeptByThread() { kept() = std::move(value_); }
  KeptByThread(const KeptByThread&) = delete;
  KeptByThread& operator=(const KeptByThread&) = delete;

  [[nodiscard]] T* operator->() noexcept { return &value_; }
  [[nodiscard]] T& operator*() noexcept { return value_; }

 private:
  static T& kept() noexcept {
    thread_local T value;
    return value;
  }
  T value_;
};

// The first `count` elements of an array that is kept, whatever they hold.
template <class T>
[[nodiscard]] std::span<T> room_for(AlignedVector<T>& kept, std::size_t count) {
  if (kept.size() < count) kept.resize(count);
  return {kept.data(), count};
}

}  // namespace perfect_bvh
