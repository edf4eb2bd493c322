// The numbers of threads that an answer must not depend on, beside one.
#pragma once

#include <vector>

namespace perfect_bvh::test {

inline std::vector<int> thread_counts() {
#if defined(__SANITIZE_THREAD__)
  return {4};  // what two threads might do wrong, four do, and it makes each twenty times as slow
#elif defined(__SANITIZE_ADDRESS__)
  return {2};  // the other is ThreadSanitizer's
#else
  return {2, 4};
#endif
}

}  // namespace perfect_bvh::test
