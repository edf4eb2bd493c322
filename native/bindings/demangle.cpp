// If the C++ library is linked statically, as in wheels, its demangler would be a twentieth of the module. pybind11
// uses it in error messages about unregistered types; without it, it prints the mangled name.

#include <cstddef>

#if defined(_LIBCPP_VERSION) && !defined(__APPLE__)

namespace {

constexpr int kNotAName = -2;  // of the C++ ABI

}  // namespace

extern "C" char* __cxa_demangle(const char*, char*, std::size_t*, int* status);

extern "C" char* __cxa_demangle(const char*, char*, std::size_t*, int* status) {
  if (status != nullptr) *status = kNotAName;
  return nullptr;
}

#endif
