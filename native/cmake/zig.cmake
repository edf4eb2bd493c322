# Toolchain file for each of Blender's systems, on any build machine. ZIG in the environment is the path of the compiler
# from the package ziglang: a Clang with its own C++ library, which it links statically, and with import libraries for
# Windows' and macOS's system libraries. ZIG_TARGET is the target in that compiler's notation, for instance
# x86_64-windows-gnu. CMake's test programs get it from the environment too.

set(CMAKE_CXX_COMPILER "$ENV{ZIG}" c++)
set(CMAKE_CXX_COMPILER_TARGET "$ENV{ZIG_TARGET}")
string(REGEX MATCH "^[^-]+" CMAKE_SYSTEM_PROCESSOR "${CMAKE_CXX_COMPILER_TARGET}")
if(CMAKE_CXX_COMPILER_TARGET MATCHES "-linux-")
  set(CMAKE_SYSTEM_NAME Linux)
elseif(CMAKE_CXX_COMPILER_TARGET MATCHES "-windows-")
  set(CMAKE_SYSTEM_NAME Windows)
  set(CMAKE_SYSTEM_VERSION 10)
  set(CMAKE_RC_COMPILER "$ENV{ZIG}")  # CMake requires it, but never runs it
elseif(CMAKE_CXX_COMPILER_TARGET MATCHES "-macos")
  set(CMAKE_SYSTEM_NAME Darwin)
  set(CMAKE_USER_MAKE_RULES_OVERRIDE_CXX "${CMAKE_CURRENT_LIST_DIR}/zig-macos-rules.cmake")
endif()

# Without this the compiler writes debug information, which makes objects many times as large, and is stripped in the
# end.
set(CMAKE_CXX_FLAGS_INIT -g0)
# Without this CMake's test programs fail, and the message says that no threads library was found.
set(CMAKE_CXX_SCAN_FOR_MODULES OFF)
# The same flags for all, or the compiler builds its C++ library once for each kind.
set(CMAKE_EXE_LINKER_FLAGS_INIT -s)
set(CMAKE_SHARED_LINKER_FLAGS_INIT -s)
set(CMAKE_MODULE_LINKER_FLAGS_INIT -s)
