// Bits of the CPUID instruction and of the register XCR0, as Intel's and AMD's manuals number them.
#include "traverse/cpu_features.h"

#if defined(__x86_64__)

#include <cpuid.h>

namespace perfect_bvh {
namespace {

constexpr unsigned bit(int number) { return 1u << number; }

// CPUID, leaf 1, ECX.
constexpr unsigned kFma = bit(12), kPopcnt = bit(23), kOsXsave = bit(27), kAvx = bit(28), kF16c = bit(29);
// Leaf 7, EBX.
constexpr unsigned kBmi = bit(3), kAvx2 = bit(5), kBmi2 = bit(8);
constexpr unsigned kAvx512F = bit(16), kAvx512Dq = bit(17), kAvx512Bw = bit(30), kAvx512Vl = bit(31);
// Leaf 0x80000001, ECX.
constexpr unsigned kLzcnt = bit(5);
// XCR0: the registers that the system saves. The halves of ymm; masks and both parts of zmm. macOS on Intel does not
// set the zmm bits until a thread uses them, so at most AVX2 is detected there.
constexpr unsigned kYmmState = bit(1) | bit(2), kZmmState = kYmmState | bit(5) | bit(6) | bit(7);

constexpr bool has_all(unsigned value, unsigned wanted) { return (value & wanted) == wanted; }

struct Registers {
  unsigned a = 0, b = 0, c = 0, d = 0;
};

Registers ask(unsigned leaf) noexcept {
  Registers found;
  __get_cpuid_count(leaf, 0, &found.a, &found.b, &found.c, &found.d);  // zeros if there is no such leaf
  return found;
}

unsigned saved_state() noexcept {
  if (!has_all(ask(1).c, kOsXsave)) return 0;
  unsigned low, high;
  __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
  return low;
}

}  // namespace

bool cpu_runs_avx2() noexcept {
  return has_all(ask(1).c, kFma | kPopcnt | kAvx | kF16c) && has_all(ask(7).b, kBmi | kAvx2 | kBmi2) &&
         has_all(ask(0x80000001u).c, kLzcnt) && has_all(saved_state(), kYmmState);
}

bool cpu_runs_avx512() noexcept {
  return cpu_runs_avx2() && has_all(ask(7).b, kAvx512F | kAvx512Dq | kAvx512Bw | kAvx512Vl) &&
         has_all(saved_state(), kZmmState);
}

}  // namespace perfect_bvh

#else

namespace perfect_bvh {

bool cpu_runs_avx2() noexcept { return false; }
bool cpu_runs_avx512() noexcept { return false; }

}  // namespace perfect_bvh

#endif
