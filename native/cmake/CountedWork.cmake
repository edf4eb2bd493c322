# Tests that count the work between two polls for cancellation. The code that makes a snapshot is compiled once more, so
# that each basic block reports when it runs (tests/work/count_work.h). They are built without warnings and sanitizers,
# which the other tests cover, and only on Linux, with a compiler that supports it.

function(perfect_bvh_add_work_tests)
  include(CheckCXXCompilerFlag)
  set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)  # the function that blocks report to is in the tests
  check_cxx_compiler_flag(-fsanitize-coverage=trace-pc PERFECT_BVH_CAN_REPORT_BLOCKS)
  if(NOT PERFECT_BVH_CAN_REPORT_BLOCKS OR NOT CMAKE_SYSTEM_NAME STREQUAL "Linux" OR CMAKE_CROSSCOMPILING)
    message(FATAL_ERROR "The tests that count work need Linux and a compiler with -fsanitize-coverage=trace-pc")
  endif()

  file(GLOB engine CONFIGURE_DEPENDS "src/core/*.cpp" "src/math/*.cpp" "src/mesh/*.cpp" "src/builders/*.cpp"
    "src/wide/*.cpp" "src/update/*.cpp" "src/blas/*.cpp" "src/tlas/*.cpp" "src/scene/*.cpp")
  file(GLOB tests CONFIGURE_DEPENDS "tests/work/test_*.cpp")
  add_library(perfect_bvh_reporting OBJECT ${engine} ${tests})
  # With line numbers, to name the blocks that ran too often.
  target_compile_options(perfect_bvh_reporting PRIVATE -O2 -g1 -ffp-contract=off -fsanitize-coverage=trace-pc)
  perfect_bvh_precompile(perfect_bvh_reporting)

  add_executable(perfect_bvh_work_tests tests/work/count_work.cpp $<TARGET_OBJECTS:perfect_bvh_reporting>)
  foreach(target perfect_bvh_reporting perfect_bvh_work_tests)
    target_include_directories(${target} PRIVATE . src)
    target_compile_definitions(${target} PRIVATE PERFECT_BVH_HAVE_AVX2=0 PERFECT_BVH_HAVE_AVX512=0
                               PERFECT_BVH_HAVE_NEON=0)
    target_link_libraries(${target} PRIVATE Threads::Threads GTest::gtest GTest::gtest_main)
  endforeach()
  gtest_discover_tests(perfect_bvh_work_tests DISCOVERY_TIMEOUT 300 PROPERTIES TIMEOUT 900)
endfunction()
