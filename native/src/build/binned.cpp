#include "build/binned.h"

#include "build/binned_splitter.h"
#include "build/top_down.h"

namespace perfect_bvh {

Bvh2 build_binned(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  BinnedSplitter splitter(prims, config, pool);
  return TopDownBuilder(splitter, pool, cancel).build(splitter.root());
}

}  // namespace perfect_bvh
