// The same rays through several competitors, in turn on each chunk of rays, in an order that is drawn again for each
// chunk and round: whatever else the machine does, it does to all of them, and none always finds in the caches what
// the same other one left there.
// In: competitors, a set of rays. Out: M rays/s of each on one thread, in its own CPU time.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "ray_sets.h"
#include "stopwatch.h"

namespace perfect_bvh::bench {

struct RayCompetitor {
  std::string name;
  std::function<void(std::span<const Ray>, Hit*)> closest;
  std::function<void(std::span<const Ray>, std::uint8_t*)> any;
};

struct RaceResult {
  double mrays_per_second = 0;  // from the lower third of the times on each chunk: what disturbs only adds time
  Spread rounds;                // M rays/s of whole rounds
};

// One result for each competitor, in their order.
[[nodiscard]] std::vector<RaceResult> race(const RaySet& set, std::span<const RayCompetitor> competitors, int rounds);

}  // namespace perfect_bvh::bench
