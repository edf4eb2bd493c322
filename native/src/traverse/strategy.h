// How a batch of rays is traced. Every way gives the same answers; they differ in what they cost.
#pragma once

#include <cstddef>
#include <cstdint>

namespace perfect_bvh {

enum class Strategy : std::uint8_t {
  kAuto,     // packets where the rays are coherent, put in order first (ray_reordering.h), the stream elsewhere
  kPackets,  // up to 64 consecutive rays share a traversal; the stream where the machine has no kernel for that
  kStream,   // many rays under way in turn
  kSingle,   // one ray after the other
};

struct TraceOptions {
  Strategy strategy = Strategy::kAuto;
  std::size_t in_flight = 0;  // rays under way in the stream, 1 to kMostRaysInFlight; 0 for the best
};

}  // namespace perfect_bvh
