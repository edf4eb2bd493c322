# What CMake's own rules for macOS are followed by, for zig.cmake: other systems' `ar` writes archives that ziglang's
# linker misreads, -bundle crashes it, and mend_mach_o.py says what is left to do. ZIG_PYTHON in the environment runs it.

set(CMAKE_CXX_ARCHIVE_CREATE "\"$ENV{ZIG}\" ar --format=darwin qc <TARGET> <OBJECTS>")
set(CMAKE_CXX_ARCHIVE_APPEND "\"$ENV{ZIG}\" ar --format=darwin q <TARGET> <OBJECTS>")
set(CMAKE_CXX_ARCHIVE_FINISH "\"$ENV{ZIG}\" ranlib <TARGET>")
set(CMAKE_CXX_CREATE_SHARED_MODULE
  "<CMAKE_CXX_COMPILER> <LANGUAGE_COMPILE_FLAGS> -shared <LINK_FLAGS> -o <TARGET> <OBJECTS> <LINK_LIBRARIES>"
  "\"$ENV{ZIG_PYTHON}\" \"${CMAKE_CURRENT_LIST_DIR}/../../release/mend_mach_o.py\" <TARGET>")
