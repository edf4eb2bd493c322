#include "blas/build_wide_tree.h"

#include <limits>

#include "blas/build_tree.h"
#include "builders/optimize.h"
#include "builders/quality.h"
#include "core/stopwatch.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"
#include "wide/wide_boxes.h"

namespace perfect_bvh {
namespace {

void build_and_collapse(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  Stopwatch watch;
  BuildConfig unoptimized = blas.config;
  unoptimized.optimize_passes = 0;
  Bvh2 tree = build_tree(blas.mesh, unoptimized, pool, cancel);
  report.build_milliseconds = watch.lap_milliseconds();
  if (blas.config.optimize_passes > 0) {
    const OptimizeBudget budget{blas.config.optimize_passes, blas.config.optimize_milliseconds};
    // From now on the settings are those that make this very tree again, however long that takes.
    blas.config.optimize_passes = optimize_bvh2(tree, budget, pool, cancel).passes;
    blas.config.optimize_milliseconds = std::numeric_limits<double>::infinity();
    report.optimize_milliseconds = watch.lap_milliseconds();
  }
  blas.quality = measure_quality(tree, cancel);
  blas.box = tree.bounds();
  watch.lap_milliseconds();
  blas.wide = collapse_mesh(tree, blas.mesh, pool, cancel);
  report.collapse_milliseconds = watch.lap_milliseconds();
}

}  // namespace

void build_wide_tree(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  if (!is_built_wide(blas.config)) return build_and_collapse(blas, report, pool, cancel);
  const Stopwatch watch;
  blas.wide = build_fast_wide(blas.mesh, pool, cancel);
  blas.box = mesh_bounds_of(blas.wide, blas.mesh);
  report.build_milliseconds = watch.milliseconds();
}

}  // namespace perfect_bvh
