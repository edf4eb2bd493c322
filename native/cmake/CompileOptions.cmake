# Compiler and linker options shared by every target, as the interface library perfect_bvh_compile_options.
#
# No -march=native: a wheel runs on any x86-64. No -ffast-math and no contraction: the same ray must give the same
# bits from every translation unit, and the error bounds of the slab and triangle tests assume IEEE arithmetic.

add_library(perfect_bvh_compile_options INTERFACE)
if(NOT MSVC)
  set(PERFECT_BVH_NO_EXCEPTIONS -fno-exceptions)
  target_compile_options(perfect_bvh_compile_options INTERFACE
    -ffp-contract=off
    -ffunction-sections
    -fdata-sections
    -Wall
    -Wextra
    -Wpedantic
    -Wshadow
    -Wconversion
    -Wnon-virtual-dtor
    -Wold-style-cast
    -Woverloaded-virtual
  )
elseif(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  # clang-cl takes options that it has no equivalent for behind /clang:
  set(PERFECT_BVH_NO_EXCEPTIONS /clang:-fno-exceptions)
  target_compile_options(perfect_bvh_compile_options INTERFACE /clang:-ffp-contract=off /Gy /W4 /utf-8)
else()
  message(FATAL_ERROR "Perfect BVH is compiled by clang-cl, which Visual Studio brings, not by ${CMAKE_CXX_COMPILER}: "
    "configure with -DCMAKE_CXX_COMPILER=clang-cl, or -T ClangCL for Visual Studio's own generators.")
endif()

if(PERFECT_BVH_WARNINGS_AS_ERRORS)
  target_compile_options(perfect_bvh_compile_options INTERFACE -Werror)
endif()

if(PERFECT_BVH_SANITIZE)
  target_compile_options(perfect_bvh_compile_options INTERFACE
    -fsanitize=${PERFECT_BVH_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(perfect_bvh_compile_options INTERFACE -fsanitize=${PERFECT_BVH_SANITIZE})
  if(PERFECT_BVH_SANITIZE MATCHES "undefined")
    # Compiles in half the time: AddressSanitizer already stops at invalid pointers.
    target_compile_options(perfect_bvh_compile_options INTERFACE
      -fno-sanitize=null,alignment,object-size,vptr,pointer-overflow,nonnull-attribute,returns-nonnull-attribute)
  endif()
endif()
