# Overrides CMake's own rules for macOS, for zig.cmake: ziglang's linker misreads archives written by other systems'
# `ar`, -bundle crashes it, and mend_mach_o.py explains the last step. ZIG_PYTHON in the environment runs that script.

set(CMAKE_CXX_ARCHIVE_CREATE "\"$ENV{ZIG}\" ar --format=darwin qc <TARGET> <OBJECTS>")
set(CMAKE_CXX_ARCHIVE_APPEND "\"$ENV{ZIG}\" ar --format=darwin q <TARGET> <OBJECTS>")
set(CMAKE_CXX_ARCHIVE_FINISH "\"$ENV{ZIG}\" ranlib <TARGET>")
set(CMAKE_CXX_CREATE_SHARED_MODULE
  "<CMAKE_CXX_COMPILER> <LANGUAGE_COMPILE_FLAGS> -shared <LINK_FLAGS> -o <TARGET> <OBJECTS> <LINK_LIBRARIES>"
  "\"$ENV{ZIG_PYTHON}\" \"${CMAKE_CURRENT_LIST_DIR}/../../release/mend_mach_o.py\" <TARGET>")
