// What a benchmark runs on: figures mean nothing without it.
#pragma once

#include <string>

namespace perfect_bvh::bench {

// The processor's name and the sizes of its caches, as Linux has them: "AMD EPYC 9R14; L1d 32K, L2 1024K, L3 32768K".
[[nodiscard]] std::string machine_name();

// The mean of the last minute.
[[nodiscard]] double load_average();

}  // namespace perfect_bvh::bench
