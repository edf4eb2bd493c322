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

// 0 where the system does not tell.
int count_in_affinity_mask() noexcept {
#if defined(__linux__)
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof(set), &set) == 0) return CPU_COUNT(&set);
#elif defined(_WIN32)
  // Of the process's group of at most 64: on a larger machine threads begin there, and Windows tells 0 of others.
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
