#include "builders/optimize.h"

#include <chrono>

#include "builders/link_tree.h"
#include "builders/reinsertion.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kSearchGrain = 256;

}  // namespace

OptimizeReport optimize_bvh2(Bvh2& tree, const OptimizeBudget& budget, ThreadPool& pool, CancelToken& cancel) {
  OptimizeReport report;
  if (tree.depth < 2) return report;  // nothing has anywhere to go
  const auto start = std::chrono::steady_clock::now();
  const auto time_is_over = [&] {
    const std::chrono::duration<double, std::milli> spent = std::chrono::steady_clock::now() - start;
    return spent.count() >= budget.milliseconds;
  };
  Reinserter optimizer(LinkTree(tree, cancel), kSearchGrain);
  report = run_passes(optimizer, budget.passes, time_is_over, pool, cancel);
  if (report.moved > 0) tree = optimizer.tree().to_bvh2(tree, cancel);
  return report;
}

}  // namespace perfect_bvh
