// Memory that runs out when a test says so, and stops that come at a chosen allocation: every place where an operation
// allocates is one where it can be interrupted, the same one in every run.
#pragma once

#include "core/cancel.h"

namespace perfect_bvh::test {

// While it lives, of all threads together, or of all but the one that made it: so many allocations succeed; then one
// alone fails, or all.
class MemoryRunsOut {
 public:
  MemoryRunsOut(long after, bool stays, bool spares_this_thread = false) noexcept;
  ~MemoryRunsOut() { end(); }
  MemoryRunsOut(const MemoryRunsOut&) = delete;
  MemoryRunsOut& operator=(const MemoryRunsOut&) = delete;
  // Whether it ever did.
  bool end() noexcept;
};

// While it lives: after so many allocations a stop is requested, and all go on to succeed. Not beside a MemoryRunsOut.
class StopComes {
 public:
  StopComes(long after, CancelToken& cancel) noexcept;
  ~StopComes() { end(); }
  StopComes(const StopComes&) = delete;
  StopComes& operator=(const StopComes&) = delete;
  // Whether it ever did.
  bool end() noexcept;
};

}  // namespace perfect_bvh::test
