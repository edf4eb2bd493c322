// Binned SAH construction (Wald 2007, "On fast construction of SAH-based bounding volume hierarchies"; lecture, "Rapid
// construction": planes independent of N).
// In: references, settings (bins, axes, costs). Out: a refittable tree with leaves where no split pays, or where
// primitives fit into one leaf of the wide tree.

#include "builders/binned_splitter.h"
#include "builders/builders.h"
#include "builders/top_down.h"

namespace perfect_bvh {

namespace {

BuildConfig down_to_single_primitives(BuildConfig config) noexcept {
  config.max_leaf_size = 1;
  config.traversal_cost = config.intersection_cost = 1.0f;
  return config;
}

}  // namespace

Bvh2 build_binned(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel,
                  const LeafLimit* leaf_limit) {
  const BuildConfig used = leaf_limit != nullptr ? down_to_single_primitives(config) : config;
  BinnedSplitter splitter(prims, used, pool, cancel, leaf_limit);
  Bvh2 tree = TopDownBuilder(splitter, pool, cancel).build(splitter.root());
  tree.has_full_leaves = leaf_limit != nullptr;
  return tree;
}

}  // namespace perfect_bvh
