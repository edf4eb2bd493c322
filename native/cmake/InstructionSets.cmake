# Kernels are compiled once for each instruction set: src/traverse/*_avx2.cpp, *_avx512.cpp and *_neon.cpp get their own
# flags, on the processors that they are for. Everything else stays baseline x86-64 or 64-bit ARM, which includes NEON.
# The macros PERFECT_BVH_HAVE_AVX2, ..._AVX512 and ..._NEON (0 or 1) say which sets the engine holds.
#
# A weak symbol in such a unit (an inline function or a template that was not inlined) could be the copy that the linker
# keeps for the whole library. It would then run on machines without these instructions. Therefore every unit is checked
# after it is compiled, and the build stops at a weak symbol. On Windows and macOS `nm` shows too little of an object;
# there release/weak_symbols.py checks when wheels are built.

set(PERFECT_BVH_ISAS avx2 avx512 neon)
set(PERFECT_BVH_LEFT_OUT_ISAS "" CACHE STRING "Of these, those that no kernels are compiled for")
set(perfect_bvh_processors_avx2 "^(x86_64|AMD64)$")
set(perfect_bvh_processors_avx512 ${perfect_bvh_processors_avx2})
set(perfect_bvh_processors_neon "^(aarch64|arm64|ARM64)$")
set(perfect_bvh_flags_avx2 -mavx2 -mfma -mbmi -mbmi2 -mlzcnt -mpopcnt -mf16c)
set(perfect_bvh_flags_avx512 ${perfect_bvh_flags_avx2} -mavx512f -mavx512bw -mavx512dq -mavx512vl)
set(perfect_bvh_flags_neon)

# Moves the sources of each instruction set out of the list named by `sources_variable`.
function(perfect_bvh_take_isa_sources sources_variable)
  set(sources ${${sources_variable}})
  foreach(isa IN LISTS PERFECT_BVH_ISAS)
    set(isa_sources ${sources})
    list(FILTER isa_sources INCLUDE REGEX "/src/traverse/[^/]*_${isa}\\.cpp$")
    list(FILTER sources EXCLUDE REGEX "_${isa}\\.cpp$")
    if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "${perfect_bvh_processors_${isa}}" OR isa IN_LIST PERFECT_BVH_LEFT_OUT_ISAS)
      set(isa_sources "")
    endif()
    set(perfect_bvh_sources_${isa} ${isa_sources} PARENT_SCOPE)
  endforeach()
  set(${sources_variable} ${sources} PARENT_SCOPE)
endfunction()

# Compiles one instruction set's units, checks them and adds their objects to `engine`.
function(perfect_bvh_add_isa_unit engine isa)
  set(units perfect_bvh_${isa})
  add_library(${units} OBJECT ${perfect_bvh_sources_${isa}})
  target_include_directories(${units} PRIVATE .)
  # Kernels throw no exceptions; with exceptions off, no terminate handler (a weak symbol) is emitted.
  target_compile_options(${units} PRIVATE ${perfect_bvh_flags_${isa}} ${PERFECT_BVH_NO_EXCEPTIONS})
  target_link_libraries(${units} PRIVATE perfect_bvh_compile_options Threads::Threads)
  target_sources(${engine} PRIVATE $<TARGET_OBJECTS:${units}>)
  if(WIN32 OR APPLE)
    return()
  endif()

  set(checked "${CMAKE_CURRENT_BINARY_DIR}/${units}.checked")
  set(script "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/check_weak_symbols.cmake")
  add_custom_command(
    OUTPUT "${checked}"
    COMMAND ${CMAKE_COMMAND} "-DNM=${CMAKE_NM}" "-DSTAMP=${checked}" "-DOBJECTS=$<TARGET_OBJECTS:${units}>"
            -P "${script}"
    DEPENDS "$<TARGET_OBJECTS:${units}>" "${script}"
    COMMENT "Checking the ${isa} kernels for weak symbols"
    VERBATIM)
  target_sources(${engine} PRIVATE "${checked}")
endfunction()

function(perfect_bvh_add_isa_units engine)
  foreach(isa IN LISTS PERFECT_BVH_ISAS)
    string(TOUPPER ${isa} upper)
    if(perfect_bvh_sources_${isa})
      perfect_bvh_add_isa_unit(${engine} ${isa})
      target_compile_definitions(${engine} PUBLIC PERFECT_BVH_HAVE_${upper}=1)
    else()
      target_compile_definitions(${engine} PUBLIC PERFECT_BVH_HAVE_${upper}=0)
    endif()
  endforeach()
endfunction()
