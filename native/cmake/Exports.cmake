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
  else()
    set(exports "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/exports.map")
    target_link_options(${module} PRIVATE "LINKER:--version-script=${exports}" LINKER:--gc-sections)
    set_target_properties(${module} PROPERTIES LINK_DEPENDS "${exports}")
  endif()
endfunction()
