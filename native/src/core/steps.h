// Loops over all primitives or nodes that ask whether to stop (core/cancel.h) every so many items: what lies between
// two questions is then bounded, however large the data. On threads other than the token's owner a question only sees a
// stop; the owner asks while it waits for them.
#pragma once

#include <algorithm>
#include <cstddef>

#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

// A question costs as much as some ten items.
inline constexpr std::size_t kItemsBetweenAsking = 16384;

// Into how many chunks of so many for_chunks() divides them.
[[nodiscard]] constexpr std::size_t chunk_count_of(std::size_t item_count) noexcept {
  return (item_count + kItemsBetweenAsking - 1) / kItemsBetweenAsking;
}

// On this thread alone: body(begin, end) for consecutive parts of [0, count), at least one. Nothing is asked of a count
// that is one part.
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

// The same from the last part to the first.
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

// On the pool's threads: parallel_for that asks before each chunk, and while the caller waits for the others.
template <class Body>
void for_chunks(ThreadPool& pool, std::size_t count, std::size_t grain, CancelToken& cancel, const Body& body) {
  const auto run = [&](std::size_t begin, std::size_t end) {
    cancel.checkpoint();
    body(begin, end);
  };
  parallel_for(pool, count, grain, run, 0, [&] { cancel.checkpoint(); });
}

// For loops that do not know how many items there are.
class Steps {
 public:
  explicit Steps(CancelToken& cancel) noexcept : cancel_(cancel) {}

  // Before each item.
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
