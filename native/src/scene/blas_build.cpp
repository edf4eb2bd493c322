#include "scene/blas_build.h"

#include "build/builder.h"

namespace perfect_bvh {

Bvh2 build_tree(const TriangleMesh& mesh, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  AlignedVector<PrimRef> prims(mesh.triangle_count());
  constexpr std::size_t kGrain = 16384;
  parallel_for(pool, prims.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    cancel.throw_if_stopped();
    for (std::size_t i = begin; i < end; ++i) {
      const Aabb box = mesh.triangle_box(i);
      prims[i] = {box.lower, static_cast<std::uint32_t>(i), box.upper, 0};
    }
  });
  return build_bvh2(prims, config, pool, cancel);
}

}  // namespace perfect_bvh
