#include "update/tree_sample.h"

#include <algorithm>

#include "builders/builder.h"
#include "builders/quality.h"

namespace perfect_bvh {

double measure_tree_sample(const TriangleMesh& mesh, ThreadPool& pool) {
  const std::size_t count = mesh.triangle_count();
  const std::size_t step = std::max<std::size_t>(1, count / std::clamp<std::size_t>(count / 16, 64, 1024));
  AlignedVector<PrimRef> sample;
  sample.reserve(count / step + 1);
  for (std::size_t i = 0; i < count; i += step) {
    const Aabb box = mesh.triangle_box(i);
    sample.push_back({box.lower, static_cast<std::uint32_t>(sample.size()), box.upper, 0});
  }
  if (sample.empty()) return 0;
  BuildConfig config;
  config.builder = BuilderKind::kBinned;
  config.max_leaf_size = 4;
  CancelToken cancel;  // its own: this is no progress, and over at once
  const Bvh2 tree = build_bvh2(sample, config, pool, cancel);
  const Vec3d e = to_double(tree.bounds().upper) - to_double(tree.bounds().lower);
  return e.x * e.y + e.y * e.z + e.z * e.x > 0 ? measure_quality(tree).sah : 0;
}

}  // namespace perfect_bvh
