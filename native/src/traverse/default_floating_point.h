// Sets the floating-point mode that kernels need: denormals on, round to nearest, no traps. The caller or another
// library in the process may have changed it. The destructor restores the thread's settings.
#pragma once

#include <cstdint>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace perfect_bvh {

class DefaultFloatingPoint {
 public:
  DefaultFloatingPoint() noexcept : saved_(read()) { write(kDefault); }
  ~DefaultFloatingPoint() { write(saved_); }
  DefaultFloatingPoint(const DefaultFloatingPoint&) = delete;
  DefaultFloatingPoint& operator=(const DefaultFloatingPoint&) = delete;

 private:
#if defined(__x86_64__)
  using Word = unsigned;
  static constexpr Word kDefault = 0x1F80;  // MXCSR: all exceptions masked
  static Word read() noexcept { return _mm_getcsr(); }
  static void write(Word word) noexcept { _mm_setcsr(word); }
#elif defined(__aarch64__)
  using Word = std::uint64_t;
  static constexpr Word kDefault = 0;  // FPCR
  static Word read() noexcept {
    Word word;
    __asm__ volatile("mrs %0, fpcr" : "=r"(word) : : "memory");
    return word;
  }
  static void write(Word word) noexcept { __asm__ volatile("msr fpcr, %0" : : "r"(word) : "memory"); }
#else
#error "Say how this processor's floating-point settings are read and written"
#endif

  Word saved_;
};

}  // namespace perfect_bvh
