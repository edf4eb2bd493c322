// Builds a mesh's binary tree, with the builder that suits the mesh's usage.
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

// The changes that the owner of a mesh expects.
enum class Usage : std::uint8_t {
  kStatic,     // none, or rigid motion
  kDeforming,  // its positions change
  kChanging,   // its topology changes
};

// Returns the name that users write.
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

// Chooses a builder if the choice was left to the engine. A tree that lasts for one frame must be built fast; for all
// others a better tree pays off.
[[nodiscard]] BuildConfig choose_builder(BuildConfig config, Usage usage) noexcept;

// Returns whether the wide tree is built directly: with the fast builder, unless a setting needs a binary tree.
[[nodiscard]] bool is_built_wide(const BuildConfig& config) noexcept;

[[nodiscard]] Bvh2 build_tree(const Mesh& mesh, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel);

// Build wide tree -----------------------------------------------------------------------------------------------------
// Makes the tree that rays are traced through from a mesh, with the builder of its settings. A binary tree is built and
// collapsed, or the wide tree is built directly.

// Fills in the tree of `blas`, its quality and its box. In: the mesh and `config`, with a specific builder; the
// optimization passes done are stored in it. Out: the duration of each step, in the report. Throws Cancelled,
// bad_alloc.
void build_wide_tree(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
