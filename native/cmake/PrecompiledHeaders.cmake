# The standard library's headers that most files include, compiled once for each target. Reading them is a third to a
# half of what a file of the engine costs. The preset "tests" does without, so that a forgotten #include is noticed.

function(perfect_bvh_precompile target)
  if(PERFECT_BVH_PRECOMPILED_HEADERS)
    target_precompile_headers(${target} PRIVATE ${ARGN}
      <algorithm> <array> <atomic> <cmath> <condition_variable> <cstring> <functional> <limits> <memory> <mutex>
      <numeric> <optional> <span> <string> <thread> <utility> <vector>)
  endif()
endfunction()
