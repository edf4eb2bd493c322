#include "core/processors.h"

#if defined(__linux__)
#include <sched.h>
#elif defined(_WIN32)
#define WIN32_LEAN_AND_MEAN
#define NOMINMAX
#include <windows.h>
#endif

#include <algorithm>
#include <bit>
#include <cstdint>
#include <thread>

namespace perfect_bvh {
namespace {

// Returns 0 if the system does not report it.
int count_in_affinity_mask() noexcept {
#if defined(__linux__)
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof(set), &set) == 0) return CPU_COUNT(&set);
#elif defined(_WIN32)
  // The mask covers the process's group of at most 64 processors. On a larger machine threads start there, and Windows
  // returns 0 for other groups.
  DWORD_PTR ours = 0, every = 0;
  if (GetProcessAffinityMask(GetCurrentProcess(), &ours, &every) != 0) return std::popcount(std::uint64_t{ours});
#endif
  return 0;
}

}  // namespace

int usable_processor_count() noexcept {
  const int count = count_in_affinity_mask();
  return std::max(1, count > 0 ? count : static_cast<int>(std::thread::hardware_concurrency()));
}

}  // namespace perfect_bvh
