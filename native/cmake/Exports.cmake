# Nothing but PyInit_* may leave the module: other copies of operator new and of pybind11 live in Blender's process.
# What nothing refers to is left out besides.

function(perfect_bvh_export_init_alone module)
  target_compile_definitions(${module} PRIVATE PYBIND11_EXPORT_EXCEPTION=)  # nobody else catches what it throws
  if(WIN32)
    if(NOT MSVC)  # whose linker does so by itself
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

# Gives the module an operator new of its own. The source says why.
function(perfect_bvh_hide_operator_new module)
  set(source bindings/macos/operator_new.cpp)
  target_sources(${module} PRIVATE ${source})
  set_source_files_properties(${source} PROPERTIES
    COMPILE_OPTIONS -fvisibility-global-new-delete=force-hidden SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()
