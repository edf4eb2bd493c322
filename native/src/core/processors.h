// Counts the processors that this process may use.
#pragma once

namespace perfect_bvh {

// Returns at least 1. On Linux and Windows, the size of the affinity mask; on macOS, which has none, the number of
// processors. A limited share of a processor's time, as set by containers and job objects, counts as a whole processor.
[[nodiscard]] int usable_processor_count() noexcept;

}  // namespace perfect_bvh
