// The strategies of our kernels, by the names that the programs here accept and print.
#pragma once

#include <stdexcept>
#include <string>

#include "traverse/dispatch.h"

namespace perfect_bvh::bench {

inline Strategy parse_strategy(const std::string& name) {
  if (name == "auto") return Strategy::kAuto;
  if (name == "packets") return Strategy::kPackets;
  if (name == "stream") return Strategy::kStream;
  if (name == "single") return Strategy::kSingle;
  throw std::runtime_error("no strategy is called " + name + "; there are auto, packets, stream, single");
}

// "avx2/auto".
inline std::string way_name(const std::string& isa, const std::string& strategy) { return isa + "/" + strategy; }

}  // namespace perfect_bvh::bench
