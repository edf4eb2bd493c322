// Where the C++ library is linked statically, as in wheels, its demangler would be a twentieth of the module. pybind11
// asks for it in messages about types that nobody registered, and goes on with the name as the compiler wrote it.

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
