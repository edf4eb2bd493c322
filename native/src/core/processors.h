// How many processors this process may use.
#pragma once

namespace perfect_bvh {

// At least 1. On Linux and Windows as many as the affinity mask allows, on macOS, which has none, as many as there are.
// A share of a processor's time, as containers and job objects may limit it, counts as the whole.
[[nodiscard]] int usable_processor_count() noexcept;

}  // namespace perfect_bvh
