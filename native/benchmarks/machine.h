// The machine that a benchmark runs on, without which its results have no meaning.
#pragma once

#include <string>

namespace perfect_bvh::bench {

// Returns the processor and its cache sizes, as Linux reports them: "AMD EPYC 9R14; L1d 32K, L2 1024K, L3 32768K".
[[nodiscard]] std::string machine_name();

// Returns the load average of the last minute.
[[nodiscard]] double load_average();

}  // namespace perfect_bvh::bench
