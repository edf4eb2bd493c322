# cmake -DNM=nm -DOBJECTS=a.o;b.o -DSTAMP=file -P check_weak_symbols.cmake
#
# Fails if an object defines a weak or unique symbol (nm's W, V, u). The only exception is the reference to the
# exception handler's personality routine: a pointer, which holds no instructions.

foreach(object IN LISTS OBJECTS)
  execute_process(
    COMMAND "${NM}" --demangle --defined-only "${object}"
    OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
  string(REPLACE "\n" ";" symbols "${symbols}")
  list(FILTER symbols INCLUDE REGEX "^[0-9a-fA-F]* *[WwVvu] ")
  list(FILTER symbols EXCLUDE REGEX " DW\\.ref\\.__gxx_personality_v0$")
  if(symbols)
    list(JOIN symbols "\n  " listed)
    message(FATAL_ERROR
      "${object} defines weak symbols:\n  ${listed}\n"
      "Give them internal linkage (static or an unnamed namespace) in the headers that kernels include.")
  endif()
endforeach()

file(TOUCH "${STAMP}")
