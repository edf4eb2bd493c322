// Casts the same rays with several competitors, which take turns on each batch of rays, in an order that is drawn again
// for each batch and round. So other load on the machine affects all of them alike, and none always finds the caches as
// the same other competitor left them. Each gets its rays in its own format before timing starts (ray_caster.h).
// In: competitors, a set of rays. Out: M rays/s of each on one thread, in CPU time, and the agreement of its answers.
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
  std::size_t batch = kBatch;  // a smaller set is one batch; the last batch may be smaller
  double diagonal = 0;         // of the scene; differences of t are relative to it
};

struct RaceResult {
  double mrays_per_second = 0;  // from the fastest third of the times on each batch: disturbances only add time
  Spread rounds;                // M rays/s of whole rounds
  Agreement agreement;          // with the first competitor
};

// One result for each competitor, in their order.
[[nodiscard]] std::vector<RaceResult> race(const RaySet& set, std::span<const RayCompetitor> competitors,
                                           const RaceOptions& options);

}  // namespace perfect_bvh::bench
