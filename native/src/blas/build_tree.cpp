#include "blas/build_tree.h"

#include "builders/builder.h"
#include "core/scratch.h"
#include "core/steps.h"
#include "mesh/triangle_clip.h"
#include "wide/leaf_block.h"

namespace perfect_bvh {
namespace {

// Spatial splits know boxes alone; here they learn where a slice of a triangle lies.
class TriangleClipper final : public PrimClipper {
 public:
  explicit TriangleClipper(const Mesh& mesh) : mesh_(mesh) {}

  void slice(std::uint32_t prim_index, int axis, std::span<const float> planes, Box4* slices) const noexcept override {
    const TriangleIndices t = mesh_.triangles[prim_index];
    slice_triangle(mesh_.positions[t.x], mesh_.positions[t.y], mesh_.positions[t.z], axis, planes, slices);
  }

 private:
  const Mesh& mesh_;
};

class TriangleLeafLimit final : public LeafLimit {
 public:
  TriangleLeafLimit(const Mesh& mesh, TreeLayout layout)
      : LeafLimit(mesh.triangles.data(), sizeof(TriangleIndices)), mesh_(mesh), layout_(layout) {}

  [[nodiscard]] bool fits(std::span<const std::uint32_t> prim_indices) const noexcept override {
    return fit_one_leaf(prim_indices, mesh_.triangles.data(), layout_);
  }

 private:
  const Mesh& mesh_;
  const TreeLayout layout_;
};

// Whether the leaf costs and limits are the defaults: explicit ones are kept.
bool leaves_are_free(const BuildConfig& config) noexcept {
  const BuildConfig usual;
  return config.traversal_cost == usual.traversal_cost && config.intersection_cost == usual.intersection_cost &&
         config.max_leaf_size == usual.max_leaf_size;
}

}  // namespace

BuildConfig choose_builder(BuildConfig config, Usage usage) noexcept {
  if (config.builder != BuilderKind::kAuto) return config;
  config.builder = usage == Usage::kChanging ? BuilderKind::kFast : BuilderKind::kBinned;
  config.fills_leaves = config.builder == BuilderKind::kBinned && leaves_are_free(config);
  return config;
}

bool is_built_wide(const BuildConfig& config) noexcept {
  return config.builder == BuilderKind::kFast && config.optimize_passes == 0 && leaves_are_free(config);
}

Bvh2 build_tree(const Mesh& mesh, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  Scratch scratch;
  const auto prims = scratch.take<PrimRef>(mesh.primitive_count());
  for_chunks(pool, prims.size(), kItemsBetweenAsking, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Aabb box = mesh.primitive_box(i);
      prims[i] = {box.lower, static_cast<std::uint32_t>(i), box.upper, 0};
    }
  });
  const TriangleClipper clipper(mesh);
  const TriangleLeafLimit leaf_limit(mesh, config.layout);
  return build_bvh2(prims, config, pool, cancel, &clipper, &leaf_limit);
}

}  // namespace perfect_bvh
