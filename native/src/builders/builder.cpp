#include "builders/builder.h"

#include <limits>
#include <string>

#include "builders/builders.h"
#include "builders/optimize.h"
#include "core/errors.h"

namespace perfect_bvh {
namespace {

void require(bool holds, const char* setting, const char* expected, double got) {
  if (holds) return;
  throw InvalidArgument(std::string("BuildConfig: ") + setting + " must be " + expected + ", got " +
                        std::to_string(got));
}

void check(const BuildConfig& config) {
  require(config.bins >= 2 && config.bins <= 256, "bins", "from 2 to 256", config.bins);
  require(config.axes == 1 || config.axes == 3, "axes", "1 or 3", config.axes);
  require(config.max_leaf_size >= 1 && config.max_leaf_size <= 255, "max_leaf_size", "from 1 to 255",
          config.max_leaf_size);
  require(config.traversal_cost >= 0 && config.traversal_cost <= 1e6f, "traversal_cost", "from 0 to 1e6",
          static_cast<double>(config.traversal_cost));
  require(config.intersection_cost >= 1e-6f && config.intersection_cost <= 1e6f, "intersection_cost",
          "from 1e-6 to 1e6", static_cast<double>(config.intersection_cost));
  require(config.optimize_milliseconds >= 0, "optimize_milliseconds", "0 or more", config.optimize_milliseconds);
  require(config.duplication_budget >= 0 && config.duplication_budget <= 10, "duplication_budget", "from 0 to 10",
          static_cast<double>(config.duplication_budget));
}

Bvh2 build_unoptimized(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel,
                       const PrimClipper* clipper, const LeafLimit* leaf_limit) {
  switch (config.builder) {
    case BuilderKind::kAuto:
    case BuilderKind::kBinned:
      return build_binned(prims, config, pool, cancel, config.fills_leaves ? leaf_limit : nullptr);
    case BuilderKind::kMedian:
      return build_median(prims, config, pool, cancel);
    case BuilderKind::kSweep:
      return build_sweep(prims, config, pool, cancel);
    case BuilderKind::kFast:
      return build_fast(prims, config, pool, cancel);
    case BuilderKind::kSpatial:
      return build_spatial(prims, config, clipper, pool, cancel);
  }
  throw InvalidArgument("BuildConfig: this builder is not available");
}

}  // namespace

BuilderKind find_builder(std::string_view name) {
  for (const BuilderName& builder : kBuilders) {
    if (name == builder.name) return builder.kind;
  }
  throw InvalidArgument("BuildConfig: unknown builder '" + std::string(name) + "'");
}

Bvh2 build_bvh2(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel,
                const PrimClipper* clipper, const LeafLimit* leaf_limit) {
  check(config);
  constexpr std::size_t kMaxPrims = std::numeric_limits<std::int32_t>::max();  // node indices have 32 bits
  if (prims.size() > kMaxPrims) {
    throw InvalidArgument("build_bvh2: expected at most 2147483647 primitives, got " + std::to_string(prims.size()));
  }
  if (prims.empty()) return {};
  Bvh2 tree = build_unoptimized(prims, config, pool, cancel, clipper, leaf_limit);
  if (config.optimize_passes > 0) {
    optimize_bvh2(tree, {config.optimize_passes, config.optimize_milliseconds}, pool, cancel);
  }
  return tree;
}

}  // namespace perfect_bvh
