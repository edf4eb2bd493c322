# Toolchain file: any of Blender's systems, whatever machine compiles. ZIG in the environment is the path of the compiler
# from the package ziglang: a Clang with its own C++ library, which it links statically, and with what Windows' and
# macOS's system libraries are called by. ZIG_TARGET is what to compile for as that compiler writes it, for instance
# x86_64-windows-gnu; CMake's test programs are told it by the environment as well.

set(CMAKE_CXX_COMPILER "$ENV{ZIG}" c++)
set(CMAKE_CXX_COMPILER_TARGET "$ENV{ZIG_TARGET}")
string(REGEX MATCH "^[^-]+" CMAKE_SYSTEM_PROCESSOR "${CMAKE_CXX_COMPILER_TARGET}")
if(CMAKE_CXX_COMPILER_TARGET MATCHES "-linux-")
  set(CMAKE_SYSTEM_NAME Linux)
elseif(CMAKE_CXX_COMPILER_TARGET MATCHES "-windows-")
  set(CMAKE_SYSTEM_NAME Windows)
  set(CMAKE_SYSTEM_VERSION 10)
  set(CMAKE_RC_COMPILER "$ENV{ZIG}")  # asked for by CMake, and never run
elseif(CMAKE_CXX_COMPILER_TARGET MATCHES "-macos")
  set(CMAKE_SYSTEM_NAME Darwin)
  set(CMAKE_USER_MAKE_RULES_OVERRIDE_CXX "${CMAKE_CURRENT_LIST_DIR}/zig-macos-rules.cmake")
endif()

# Without this it writes debug information, which makes objects many times as large, and is stripped in the end.
set(CMAKE_CXX_FLAGS_INIT -g0)
# Without this CMake's test programs fail, and the message says that no threads library was found.
set(CMAKE_CXX_SCAN_FOR_MODULES OFF)
# All alike, or the compiler builds its C++ library once for each kind.
set(CMAKE_EXE_LINKER_FLAGS_INIT -s)
set(CMAKE_SHARED_LINKER_FLAGS_INIT -s)
set(CMAKE_MODULE_LINKER_FLAGS_INIT -s)
