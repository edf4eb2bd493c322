# Only PyInit_* may be exported: other copies of operator new and of pybind11 exist in Blender's process. Unreferenced
# code is removed.

function(perfect_bvh_export_init_alone module)
  target_compile_definitions(${module} PRIVATE PYBIND11_EXPORT_EXCEPTION=)  # no other module catches its exceptions
  if(WIN32)
    if(NOT MSVC)  # MSVC's linker removes it by default
      target_link_options(${module} PRIVATE LINKER:--gc-sections)
    endif()
  elseif(APPLE)
    target_link_options(${module} PRIVATE LINKER:-dead_strip)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "AppleClang")
      target_link_options(${module} PRIVATE "LINKER:-exported_symbol,_PyInit_*")
    else()
      perfect_bvh_hide_operator_new(${module})
    endif()
  else()
    set(exports "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/exports.map")
    target_link_options(${module} PRIVATE "LINKER:--version-script=${exports}" LINKER:--gc-sections)
    set_target_properties(${module} PROPERTIES LINK_DEPENDS "${exports}")
  endif()
endfunction()

# Gives the module its own operator new. The source file explains why.
function(perfect_bvh_hide_operator_new module)
  set(source bindings/macos/operator_new.cpp)
  target_sources(${module} PRIVATE ${source})
  set_source_files_properties(${source} PROPERTIES
    COMPILE_OPTIONS -fvisibility-global-new-delete=force-hidden SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()
