// From a mesh to its binary tree, by the builder that suits what the mesh is for.
#pragma once

#include <cstdint>

#include "blas/blas.h"
#include "builders/builder.h"
#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "stats/statistics.h"

namespace perfect_bvh {

// What the owner of a mesh expects to happen to it.
enum class Usage : std::uint8_t {
  kStatic,     // nothing, or rigid motion
  kDeforming,  // its positions change
  kChanging,   // its topology changes
};

// As users write it.
[[nodiscard]] constexpr const char* usage_name(Usage usage) noexcept {
  switch (usage) {
    case Usage::kStatic:
      return "static";
    case Usage::kDeforming:
      return "deforming";
    case Usage::kChanging:
      return "changing";
  }
  return "";
}

// Names the builder where the choice was left to the engine: a tree that lasts for a frame must be built fast,
// any other repays a better one.
[[nodiscard]] BuildConfig choose_builder(BuildConfig config, Usage usage) noexcept;

// Whether the tree is built straight into the wide one: the fast builder's, unless something was asked for that needs a
// binary tree.
[[nodiscard]] bool is_built_wide(const BuildConfig& config) noexcept;

[[nodiscard]] Bvh2 build_tree(const Mesh& mesh, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel);

// Build wide tree -----------------------------------------------------------------------------------------------------
// From a mesh to the tree that rays are traced through, by the builder of its settings: a binary tree is built and
// collapsed, or the wide one is built at once.

// Fills in the tree of `blas`, its quality and its box. In: the mesh and `config`, its builder named; optimisation is
// noted there as it was done. Out: how long the steps took, in the report. Throws Cancelled, bad_alloc.
void build_wide_tree(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
