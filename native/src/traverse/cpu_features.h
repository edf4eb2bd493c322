// Detects the kernels that this processor and its system can run. Reads the processor's registers directly:
// `__builtin_cpu_supports` needs a part of the compiler's run-time library that some toolchains do not initialize; it
// then returns false for everything.
#pragma once

namespace perfect_bvh {

// Checks the features that kernel_avx2.cpp is compiled for, and that the system saves 256-bit registers.
[[nodiscard]] bool cpu_runs_avx2() noexcept;

// Checks the additional features that kernel_avx512.cpp is compiled for, and that the system saves 512-bit registers.
[[nodiscard]] bool cpu_runs_avx512() noexcept;

}  // namespace perfect_bvh
