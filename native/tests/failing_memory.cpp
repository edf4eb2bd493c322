#include "tests/failing_memory.h"

#include <atomic>
#include <cstdlib>
#include <new>
#include <thread>

namespace {

constexpr long kFar = 1L << 60;

// The number of allocations, of all threads, that still succeed; far from 0 unless a test counts them.
std::atomic<long> allocations_left{kFar};
// Whether all allocations after the first failed one fail too, or only that one.
std::atomic<bool> stays_exhausted{false};
// The thread whose allocations neither count nor fail.
std::atomic<std::thread::id> spared{};
// If set, this token is stopped instead of failing an allocation.
std::atomic<perfect_bvh::CancelToken*> stopped{nullptr};

bool is_refused() noexcept {
  if (spared.load(std::memory_order_relaxed) == std::this_thread::get_id()) return false;
  const long left = allocations_left.fetch_sub(1, std::memory_order_relaxed);
  if (left > 0) return false;
  if (perfect_bvh::CancelToken* const token = stopped.load(std::memory_order_relaxed)) {
    token->request_stop();
    return false;
  }
  return left == 0 || stays_exhausted.load(std::memory_order_relaxed);
}

void* allocate(std::size_t size, std::size_t alignment) {
  if (is_refused()) throw std::bad_alloc();
  void* const memory = std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

// Replace the operators of the whole test program.
void* operator new(std::size_t size) { return allocate(size == 0 ? 1 : size, alignof(std::max_align_t)); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size == 0 ? 1 : size, static_cast<std::size_t>(alignment));
}
void* operator new(std::size_t size, const std::nothrow_t& /*unused*/) noexcept {
  try {
    return allocate(size == 0 ? 1 : size, alignof(std::max_align_t));
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t& /*unused*/) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace perfect_bvh::test {

MemoryRunsOut::MemoryRunsOut(long after, bool stays, bool spares_this_thread) noexcept {
  spared = spares_this_thread ? std::this_thread::get_id() : std::thread::id();
  stays_exhausted = stays;
  allocations_left = after;
}

bool MemoryRunsOut::end() noexcept {
  const bool ran_out = allocations_left.exchange(kFar) < 0;
  stays_exhausted = false;
  spared = std::thread::id();
  return ran_out;
}

StopComes::StopComes(long after, CancelToken& cancel) noexcept {
  stopped = &cancel;
  allocations_left = after;
}

bool StopComes::end() noexcept {
  stopped = nullptr;
  return allocations_left.exchange(kFar) < 0;
}

}  // namespace perfect_bvh::test
