# Toolchain file: Linux with a glibc of at least 2.28, whatever machine compiles. ZIG in the environment is the path of
# the compiler from the package ziglang: a Clang with its own C++ library, which it links statically. ZIG_PROCESSOR is
# the machine to compile for, x86_64 or aarch64; CMake's test programs are told it by the environment as well.

set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR "$ENV{ZIG_PROCESSOR}")
set(CMAKE_CXX_COMPILER "$ENV{ZIG}" c++)
set(CMAKE_CXX_COMPILER_TARGET ${CMAKE_SYSTEM_PROCESSOR}-linux-gnu.2.28)

# Without this CMake's test programs fail, and the message says that no threads library was found.
set(CMAKE_CXX_SCAN_FOR_MODULES OFF)
# All alike, or the compiler builds its C++ library once for each kind.
set(CMAKE_EXE_LINKER_FLAGS_INIT -s)
set(CMAKE_SHARED_LINKER_FLAGS_INIT -s)
set(CMAKE_MODULE_LINKER_FLAGS_INIT -s)
