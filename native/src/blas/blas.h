// Memory that is no longer in use, kept for the next tree or the next positions of the same mesh. A system takes as
// long to allocate new memory as a refit or a copy takes to fill it. Snapshots may be destroyed in any order, on any
// thread: memory returns here when its last user releases it.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "blas/world_box.h"
#include "builders/builder.h"
#include "builders/quality.h"
#include "core/aligned.h"
#include "math/round_segment.h"
#include "math/vec3.h"
#include "mesh/round_mesh.h"
#include "traverse/scene_view.h"
#include "wide/wide_bvh.h"
#include "wide/wide_cost.h"
#include "wide/wide_refit.h"

namespace perfect_bvh {

template <class T>
class SpareMemory {
 public:
  void give(T memory) noexcept {
    const std::lock_guard lock(mutex_);
    std::swap(memory_, memory);
  }
  // Returns the memory given last, or an empty one.
  [[nodiscard]] T take() noexcept {
    const std::lock_guard lock(mutex_);
    return std::exchange(memory_, T{});
  }

 private:
  std::mutex mutex_;
  T memory_;
};

struct ShapedTree {
  WideBvh wide;
  std::uint64_t shape = 0;  // see new_tree_shape()
};

using SpareTree = SpareMemory<ShapedTree>;
// The positions of triangles' vertices, or spheres.
struct Points {
  AlignedVector<Vec3f> positions;
  AlignedVector<Ball> balls;
};
using SparePositions = SpareMemory<Points>;

// Returns a number for the shape of a wide tree: the arrangement of its nodes, leaves and triangles. Trees with the
// same number differ only in boxes and positions. 0: unknown.
[[nodiscard]] inline std::uint64_t new_tree_shape() noexcept {
  static std::atomic<std::uint64_t> last{0};
  return last.fetch_add(1, std::memory_order_relaxed) + 1;
}

// Blas ----------------------------------------------------------------------------------------------------------------
// The tree of one distinct mesh (bottom-level acceleration structure), with its geometry.

// Immutable once a snapshot refers to it.
struct Blas {
  explicit Blas(std::shared_ptr<const Mesh> the_mesh) : owned_mesh(std::move(the_mesh)), mesh(*owned_mesh) {}
  Blas(const Blas&) = delete;
  Blas& operator=(const Blas&) = delete;
  ~Blas() {
    if (spare) spare->give({std::move(wide), shape});
  }

  const std::shared_ptr<const Mesh> owned_mesh;
  const Mesh& mesh;
  BuildConfig config;   // of the build, with a specific builder; refits keep it
  TreeQuality quality;  // of the binary tree that was collapsed to `wide`; empty if there was none, or after a refit
  WideBvh wide;         // the tree that rays are traced through
  RoundLeaves round_leaves;  // of `wide`, over curves or points
  std::uint64_t shape = 0;
  std::shared_ptr<const WideCosts> fresh_costs;  // of each part of `wide` when it was built; null before a refit
  double built_sah = 0;              // of `wide` when it was built, computed as in tree_boxes.h; 0 before a refit
  RefitPlan refit_plan;              // of `wide`; empty before a refit
  std::shared_ptr<SpareTree> spare;  // receives `wide` in the end; null: nothing does
  Aabb box;                          // around the triangles
  LazySupport support;               // of `wide`, made for turned instances if there are many
  // For a mesh that moves within the shutter (moved_mesh.h): its trees at the later steps, of which only the parts that
  // rays need are filled in, and all of its steps as kernels read them.
  std::vector<std::shared_ptr<Blas>> later;
  std::vector<TreeStep> steps;
};

// Returns the kernels' view of the leaves of a tree over curves or points and of its mesh. Neither may move in memory.
[[nodiscard]] inline RoundLeaves view_leaves(const WideBvh& tree, const Mesh& mesh) noexcept {
  const CurveLeaf* const curves = tree.curve_leaves.empty() ? nullptr : tree.curve_leaves.data();
  return {tree.point_leaves.data(), curves, round_list(mesh, {}, tree.scale)};
}

// Returns the view of the leaves of a finished tree.
[[nodiscard]] inline LeafView view_leaves(const Blas& blas) noexcept {
  if (blas.mesh.is_round()) return {.round_leaves = &blas.round_leaves};
  return {.blocks = blas.wide.blocks.data()};
}

// Returns the bytes of the refit data; 0 before the first refit.
[[nodiscard]] inline std::size_t plan_byte_count(const Blas& blas) noexcept {
  return blas.refit_plan.byte_count() + (blas.fresh_costs ? blas.fresh_costs->byte_count() : 0);
}

// Returns the bytes of the steps after the first, for a mesh that moves within the shutter.
[[nodiscard]] inline std::size_t motion_byte_count(const Blas& blas) noexcept {
  std::size_t count = 0;
  for (const auto& step : blas.later) {
    count += step->mesh.positions.size() * sizeof(Vec3f) + step->mesh.balls.size() * sizeof(Ball);
    count += step->wide.byte_count();
  }
  return count;
}

// Returns the bytes of geometry, trees and plan.
[[nodiscard]] inline std::size_t byte_count(const Blas& blas) noexcept {
  return blas.mesh.byte_count() + blas.wide.byte_count() + plan_byte_count(blas) + motion_byte_count(blas);
}

}  // namespace perfect_bvh
