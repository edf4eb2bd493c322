#include "update/mesh_shape.h"

#include <algorithm>

#include "builders/builder.h"
#include "builders/quality.h"
#include "core/cancel.h"
#include "math/float4.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kSamples = 4096;

Aabb box_of(const AlignedVector<Vec3f>& positions, CancelToken& cancel) {
  Box4 box = Box4::empty();
  for_steps(positions.size(), cancel, [&](std::size_t begin, std::size_t end) {
    // Fourth lanes are ignored.
    for (std::size_t i = begin; i < end; ++i) box.grow(Float4::load_unaligned(&positions[i]));
  });
  return to_aabb(box);
}

Aabb box_of(const AlignedVector<Ball>& balls, CancelToken& cancel) {
  Aabb box;
  for_steps(balls.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) box.grow(box_of(balls[i]));
  });
  return box;
}

}  // namespace

double measure_tree_sample(const Mesh& mesh, ThreadPool& pool) {
  const std::size_t count = mesh.primitive_count();
  const std::size_t step = std::max<std::size_t>(1, count / std::clamp<std::size_t>(count / 16, 64, 1024));
  AlignedVector<PrimRef> sample;
  sample.reserve(count / step + 1);
  for (std::size_t i = 0; i < count; i += step) {
    const Aabb box = mesh.primitive_box(i);
    sample.push_back({box.lower, static_cast<std::uint32_t>(sample.size()), box.upper, 0});
  }
  if (sample.empty()) return 0;
  BuildConfig config;
  config.builder = BuilderKind::kBinned;
  config.max_leaf_size = 4;
  CancelToken cancel;  // a separate token: it reports no progress, and ends at once
  const Bvh2 tree = build_bvh2(sample, config, pool, cancel);
  return half_area(tree.bounds()) > 0 ? measure_quality(tree).sah : 0;
}

double measure_air(const Mesh& mesh, CancelToken& cancel) {
  const std::size_t step = std::max<std::size_t>(1, mesh.primitive_count() / kSamples);
  double sum = 0;
  const Aabb whole = with_kind(mesh.kind, [&](auto kind) {
    for (std::size_t i = 0; i < kind.count(mesh); i += step) {
      sum += std::max(half_area(kind.box(mesh, i)) - kind.solid_area(mesh, i), 0.0);
    }
    return box_of(kind.vertices(mesh), cancel);
  });
  const double area = whole.is_empty() ? 0 : half_area(whole);
  return area > 0 ? sum * static_cast<double>(step) / area : 0;
}

}  // namespace perfect_bvh
