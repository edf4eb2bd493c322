#include "builders/animated.h"

#include <algorithm>

#include "builders/reinsertion.h"
#include "core/errors.h"

namespace perfect_bvh {

OptimizeReport optimize_over_samples(Bvh2& tree, const SampledBoxes& boxes, std::uint32_t passes, ThreadPool& pool,
                                     CancelToken& cancel) {
  if (!tree.refittable) {
    throw InvalidArgument("optimize_over_samples: the tree's boxes are clipped (spatial splits); build another one");
  }
  if (tree.depth < 2) return {};      // nothing has anywhere to go
  constexpr std::size_t kGrain = 64;  // fewer than of one moment: each search looks at more boxes
  // Where everything flies apart no place is good and no search ends soon; elsewhere 3000 found nothing better.
  constexpr std::size_t kMostVisits = 300;
  Reinserter reinserter(SampledTree(tree, boxes, pool, cancel), kGrain, kMostVisits);
  const OptimizeReport report = run_passes(reinserter, passes, [] { return false; }, pool, cancel);
  if (report.moved > 0) tree = reinserter.tree().to_bvh2(tree, cancel);
  return report;
}

}  // namespace perfect_bvh
