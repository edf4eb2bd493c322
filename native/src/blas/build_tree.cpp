#include "blas/build_tree.h"

#include "builders/builder.h"
#include "builders/optimize.h"
#include "builders/quality.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "mesh/primitive_traits.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"
#include "wide/leaf_block.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

// Spatial splits only know boxes. This class gives them the box of a slice of a primitive.
template <class Kind>
class Clipper final : public PrimClipper {
 public:
  explicit Clipper(const Mesh& mesh) : mesh_(mesh) {}

  void slice(std::uint32_t prim_index, int axis, std::span<const float> planes, Box4* slices) const noexcept override {
    Kind::slice(mesh_, prim_index, axis, planes, slices);
  }

 private:
  const Mesh& mesh_;
};

class MeshLeafLimit final : public LeafLimit {
 public:
  explicit MeshLeafLimit(const Mesh& mesh)
      : LeafLimit(mesh.triangles.data(), mesh.triangles.empty() ? 0 : sizeof(TriangleIndices)), room_(mesh) {}

  [[nodiscard]] bool fits(std::span<const std::uint32_t> prim_indices) const noexcept override {
    return room_.holds(prim_indices);
  }

 private:
  const LeafRoom room_;
};

// Lists the boxes of all primitives; box_at(i) returns that of one. Checking the kind of each would take a sixth more
// instructions.
template <class BoxAt>
void list_boxes(std::span<PrimRef> prims, ThreadPool& pool, CancelToken& cancel, const BoxAt& box_at) {
  for_chunks(pool, prims.size(), kItemsBetweenAsking, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Aabb box = box_at(i);
      prims[i] = {box.lower, static_cast<std::uint32_t>(i), box.upper, 0};
    }
  });
}

// Returns whether the leaf costs and limits are the defaults. Explicit ones are kept.
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
  const MeshLeafLimit leaf_limit(mesh);
  return with_kind(mesh.kind, [&]<class Kind>(Kind) {
    list_boxes(prims, pool, cancel, [&](std::size_t i) { return Kind::box(mesh, i); });
    const Clipper<Kind> clipper(mesh);
    return build_bvh2(prims, config, pool, cancel, &clipper, &leaf_limit);
  });
}

// Build wide tree -----------------------------------------------------------------------------------------------------

namespace {

void build_and_collapse(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  Stopwatch watch;
  BuildConfig unoptimized = blas.config;
  unoptimized.optimize_passes = 0;
  Bvh2 tree = build_tree(blas.mesh, unoptimized, pool, cancel);
  report.build_milliseconds = watch.lap_milliseconds();
  if (blas.config.optimize_passes > 0) {
    // Keep the settings that reproduce exactly this tree.
    blas.config.optimize_passes = optimize_bvh2(tree, blas.config.optimize_passes, pool, cancel).passes;
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
