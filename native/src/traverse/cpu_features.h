// Which kernels this processor and its system can run. Asked of the processor itself: `__builtin_cpu_supports` needs
// a part of the compiler's run-time library that not every toolchain fills in, and then says no to everything.
#pragma once

namespace perfect_bvh {

// What kernel_avx2.cpp is compiled for, and registers of 256 bits that the system saves.
[[nodiscard]] bool cpu_runs_avx2() noexcept;

// What kernel_avx512.cpp is compiled for beside that, and registers of 512 bits that the system saves.
[[nodiscard]] bool cpu_runs_avx512() noexcept;

}  // namespace perfect_bvh
