// Numbers of threads, in addition to one, that an answer must not depend on.
#pragma once

#include <vector>

namespace perfect_bvh::test {

inline std::vector<int> thread_counts() {
#if defined(__SANITIZE_THREAD__)
  return {4};  // four show all errors of two; ThreadSanitizer is twenty times slower
#elif defined(__SANITIZE_ADDRESS__)
  return {2};  // ThreadSanitizer tests the other
#else
  return {2, 4};
#endif
}

}  // namespace perfect_bvh::test
