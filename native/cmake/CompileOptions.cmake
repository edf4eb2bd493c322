# Compiler and linker options shared by every target, as the interface library perfect_bvh_compile_options.
#
# No -march=native: a wheel runs on any x86-64. No -ffast-math and no contraction: the same ray must give the same
# bits from every translation unit, and the error bounds of the slab and triangle tests assume IEEE arithmetic.

add_library(perfect_bvh_compile_options INTERFACE)
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

if(PERFECT_BVH_WARNINGS_AS_ERRORS)
  target_compile_options(perfect_bvh_compile_options INTERFACE -Werror)
endif()

if(PERFECT_BVH_SANITIZE)
  target_compile_options(perfect_bvh_compile_options INTERFACE
    -fsanitize=${PERFECT_BVH_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(perfect_bvh_compile_options INTERFACE -fsanitize=${PERFECT_BVH_SANITIZE})
endif()
