// The same rays through several competitors, in turn on each batch of rays, in an order that is drawn again for each
// batch and round: whatever else the machine does, it does to all of them, and none always finds in the caches what
// the same other one left there. Each gets its rays in its own format before the clock (ray_caster.h).
// In: competitors, a set of rays. Out: M rays/s of each on one thread, in its own CPU time, and how its answers agree.
#pragma once

#include <span>
#include <vector>

#include "agreement.h"
#include "ray_caster.h"
#include "ray_sets.h"
#include "stopwatch.h"

namespace perfect_bvh::bench {

inline constexpr std::size_t kBatch = 8192;  // rays a call

struct RaceOptions {
  int rounds = 5;
  std::size_t batch = kBatch;  // a set of fewer rays is one batch; of a set's last batch there may be less
  double diagonal = 0;         // of the scene: what t is compared by
};

struct RaceResult {
  double mrays_per_second = 0;  // from the lower third of the times on each batch: what disturbs only adds time
  Spread rounds;                // M rays/s of whole rounds
  Agreement agreement;          // with the first competitor
};

// One result for each competitor, in their order.
[[nodiscard]] std::vector<RaceResult> race(const RaySet& set, std::span<const RayCompetitor> competitors,
                                           const RaceOptions& options);

}  // namespace perfect_bvh::bench
