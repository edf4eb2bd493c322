# The C++ tests that sanitizer builds leave out: they take the most time of a full check.

# ThreadSanitizer makes a test twenty times as slow, and finds nothing in a test that starts no thread. Most of these
# tests, more than half of the time, are left to the other builds, which run every test. Files that hold only such
# tests:
set(PERFECT_BVH_TESTS_WITHOUT_THREADS
  composition
  governor
  grid
  intersections
  kernels
  ray_reordering
  render
  visit_order
)

# In the other files: long tests without threads, and four that start threads only to make large trees or many trees.
# The same stages run under threads in ...GivesTheSameBytesForAnyThreadCount...
set(PERFECT_BVH_NOT_FOR_THREAD_SANITIZER
  *HardInput.GivesTheHits*
  *HardInput.MakesSoundTrees*
  *Builders.MakeSoundTrees*
  *WideRestructuring.RebuiltParts*
  *WideRestructuring.RotationsGive*
  *WideRestructuring.RestructuresATwist*
  *WideRefit.GivesSoundTightTrees*
  Agglomerative.MakesSoundTrees*
  Instances.MeetTheSame*
  Spatial.DigestsHardInput
  TopLevel.IsSoundOverHardInput

  *HardInput.IsBuiltInBoundedMemory*
  *StoppedRestructuring.*
  *WideRefit.GivesTheHitsOfAFreshTree*
  *WideRefit.HoldsOverAHundredFrames*
)

# Removes the files without threads from the list named by `sources_variable`.
function(perfect_bvh_choose_test_files sources_variable)
  if(NOT PERFECT_BVH_SANITIZE STREQUAL "thread")
    return()
  endif()
  set(sources ${${sources_variable}})
  foreach(name IN LISTS PERFECT_BVH_TESTS_WITHOUT_THREADS)
    set(source "${CMAKE_CURRENT_SOURCE_DIR}/tests/test_${name}.cpp")
    file(STRINGS "${source}" threads REGEX "std::thread|thread_count|ThreadPool [a-z_]+[({][^1]")
    if(threads)
      message(FATAL_ERROR "${source} starts threads: take it off the list PERFECT_BVH_TESTS_WITHOUT_THREADS")
    endif()
    list(REMOVE_ITEM sources "${source}")
  endforeach()
  set(${sources_variable} ${sources} PARENT_SCOPE)
endfunction()

# Sets the variable named by `filter_variable` to a GoogleTest filter. Call it after the engine is linked.
function(perfect_bvh_sanitize_tests target filter_variable)
  if(PERFECT_BVH_SANITIZE)
    # As a library, so that its option comes last.
    add_library(perfect_bvh_sanitized_tests INTERFACE)
    target_compile_options(perfect_bvh_sanitized_tests INTERFACE -O1)
    target_link_libraries(${target} PRIVATE perfect_bvh_sanitized_tests)
  endif()
  set(filter "*")
  if(PERFECT_BVH_SANITIZE STREQUAL "thread")
    list(JOIN PERFECT_BVH_NOT_FOR_THREAD_SANITIZER ":" left_out)
    set(filter "-${left_out}")
  endif()
  set(${filter_variable} "${filter}" PARENT_SCOPE)
endfunction()
