# What CMake's own rules for macOS are followed by, for zig.cmake: other systems' `ar` writes archives that ziglang's
# linker misreads, and -bundle crashes it.

set(CMAKE_CXX_ARCHIVE_CREATE "\"$ENV{ZIG}\" ar --format=darwin qc <TARGET> <OBJECTS>")
set(CMAKE_CXX_ARCHIVE_APPEND "\"$ENV{ZIG}\" ar --format=darwin q <TARGET> <OBJECTS>")
set(CMAKE_CXX_ARCHIVE_FINISH "\"$ENV{ZIG}\" ranlib <TARGET>")
set(CMAKE_SHARED_MODULE_CREATE_CXX_FLAGS -shared)
