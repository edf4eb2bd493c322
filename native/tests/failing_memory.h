// Memory that runs out, or a stop that is requested, at a chosen allocation. So an operation can be interrupted at
// every place where it allocates, and at the same place in every run.
#pragma once

#include "core/cancel.h"

namespace perfect_bvh::test {

// During its lifetime the first `after` allocations succeed; then one fails, or all later ones do. It counts the
// allocations of all threads, or of all except the one that created it.
class MemoryRunsOut {
 public:
  MemoryRunsOut(long after, bool stays, bool spares_this_thread = false) noexcept;
  ~MemoryRunsOut() { end(); }
  MemoryRunsOut(const MemoryRunsOut&) = delete;
  MemoryRunsOut& operator=(const MemoryRunsOut&) = delete;
  // Ends it. Returns whether an allocation failed.
  bool end() noexcept;
};

// During its lifetime: requests a stop after `after` allocations, which all succeed. Not together with a MemoryRunsOut.
class StopComes {
 public:
  StopComes(long after, CancelToken& cancel) noexcept;
  ~StopComes() { end(); }
  StopComes(const StopComes&) = delete;
  StopComes& operator=(const StopComes&) = delete;
  // Ends it. Returns whether the stop was requested.
  bool end() noexcept;
};

}  // namespace perfect_bvh::test
