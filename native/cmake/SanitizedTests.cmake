# What sanitizers leave out of the C++ tests: they are what a check of the whole takes longest for.

# ThreadSanitizer makes a test twenty times as slow, and sees nothing in one that starts no thread: most of those, that
# is more than half of the time, are left to the other builds, which run every test. So are three that do start threads
# but only to make large trees or many; the same stages run under threads in ...GivesTheSameBytesForAnyThreadCount...
set(PERFECT_BVH_NOT_FOR_THREAD_SANITIZER
  *HardInput.GivesTheHits*
  *HardInput.MakesSoundTrees*
  *Builders.MakeSoundTrees*
  *Kernels.Match*
  *Intersections.*
  *ReorderedRays.*
  *WideMending.RebuiltParts*
  *WideMending.RotationsGive*
  *WideMending.MendsATwist*
  *WideRefit.GivesSoundTightTrees*
  *StoppedMending.*
  Agglomerative.MakesSoundTrees*
  Instances.MeetTheSame*
  Spatial.DigestsHardInput
  TopLevel.IsSoundOverHardInput

  *HardInput.IsBuiltInBoundedMemory*
  *WideRefit.GivesTheHitsOfAFreshTree*
  *WideRefit.HoldsOverAHundredFrames*
)

# Sets the variable named by `filter_variable` to a filter of GoogleTest's. To be called once the engine is linked.
function(perfect_bvh_sanitize_tests target filter_variable)
  if(PERFECT_BVH_SANITIZE)
    # In the tests' own files, of which UndefinedBehaviorSanitizer doubles the compile time, not where the engine's are
    # concerned. AddressSanitizer stops at what is wrong with a pointer there too. A library, so that these come last.
    add_library(perfect_bvh_sanitized_tests INTERFACE)
    target_compile_options(perfect_bvh_sanitized_tests INTERFACE -O1 -fno-sanitize=null,alignment,vptr)
    target_link_libraries(${target} PRIVATE perfect_bvh_sanitized_tests)
  endif()
  set(filter "*")
  if(PERFECT_BVH_SANITIZE STREQUAL "thread")
    list(JOIN PERFECT_BVH_NOT_FOR_THREAD_SANITIZER ":" left_out)
    set(filter "-${left_out}")
  endif()
  set(${filter_variable} "${filter}" PARENT_SCOPE)
endfunction()
