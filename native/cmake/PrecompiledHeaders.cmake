# The standard library's headers that most files include, compiled once for each target. Parsing them takes a third to a
# half of the compile time of an engine file. The preset "tests" does not precompile them, so that a missing #include is
# noticed.

function(perfect_bvh_precompile target)
  if(PERFECT_BVH_PRECOMPILED_HEADERS)
    target_precompile_headers(${target} PRIVATE ${ARGN}
      <algorithm> <array> <atomic> <cmath> <condition_variable> <cstring> <functional> <limits> <memory> <mutex>
      <numeric> <optional> <span> <string> <thread> <utility> <vector>)
  endif()
endfunction()
