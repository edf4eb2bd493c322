// The settings of a build. The defaults are suitable for all uses.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

enum class BuilderKind : std::uint8_t { kAuto, kMedian, kSweep, kBinned, kSpatial, kFast };

struct BuilderName {
  BuilderKind kind;
  const char* name;  // as users write it
};

// All builders, in the order of BuilderKind.
inline constexpr BuilderName kBuilders[] = {{BuilderKind::kAuto, "auto"},       {BuilderKind::kMedian, "median"},
                                            {BuilderKind::kSweep, "sweep"},     {BuilderKind::kBinned, "binned"},
                                            {BuilderKind::kSpatial, "spatial"}, {BuilderKind::kFast, "fast"}};

static_assert([] {
  std::uint8_t place = 0;
  for (const BuilderName& builder : kBuilders) {
    if (builder.kind != BuilderKind{place++}) return false;
  }
  return true;
}());

[[nodiscard]] constexpr const char* builder_name(BuilderKind kind) noexcept {
  return kBuilders[static_cast<std::uint8_t>(kind)].name;
}

struct BuildConfig {
  BuilderKind builder = BuilderKind::kAuto;
  std::uint32_t bins = 16;            // binned, spatial: intervals per axis, 2 to 256; half of them for spatial planes
  std::uint32_t axes = 3;             // binned: 3 tries all axes, 1 only the longest
  std::uint32_t max_leaf_size = 8;    // a leaf never holds more
  float traversal_cost = 1.0f;        // SAH: cost of visiting a node ...
  float intersection_cost = 1.0f;     // ... and of testing a primitive
  float duplication_budget = 0.3f;    // spatial: references added, as a share of the primitives
  std::uint32_t optimize_passes = 0;  // reinsertion passes after the build
  bool fills_leaves = false;          // binned: stops when primitives fit into one leaf of the wide tree

  friend bool operator==(const BuildConfig&, const BuildConfig&) = default;
};

// Builder -------------------------------------------------------------------------------------------------------------
// Builds a tree over boxes with the configured builder.
// In: one PrimRef per primitive (any numbering), a cancel token. Out: a Bvh2, the same bytes for any number of threads.

// Returns the builder with the name that users write. Throws InvalidArgument if there is none.
[[nodiscard]] BuilderKind find_builder(std::string_view name);

// Builds the tree. References must not have an empty or non-finite box. Counts prims.size() units of work on `cancel`.
// Throws InvalidArgument for settings out of range (naming them), Cancelled, bad_alloc. Spatial splits use the clipper;
// without one they assume that primitives fill their boxes. With config.fills_leaves, leaves are as large as the limit
// allows; without a limit the setting is ignored.
[[nodiscard]] Bvh2 build_bvh2(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                              CancelToken& cancel, const PrimClipper* clipper = nullptr,
                              const LeafLimit* leaf_limit = nullptr);

// Builders ------------------------------------------------------------------------------------------------------------
// All builders of binary trees. Each is explained at the top of its file (builder.cpp, ...).
// In: references, not empty; settings that build_bvh2() has checked. Out: a tree, the same bytes for any number of
// threads.

[[nodiscard]] Bvh2 build_median(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                                CancelToken& cancel);

[[nodiscard]] Bvh2 build_sweep(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                               CancelToken& cancel);

// With a limit, costs and leaf size are ignored: exactly those ranges that fit become leaves.
[[nodiscard]] Bvh2 build_binned(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                                CancelToken& cancel, const LeafLimit* leaf_limit = nullptr);

[[nodiscard]] Bvh2 build_fast(std::span<const PrimRef> prims, const BuildConfig& config, ThreadPool& pool,
                              CancelToken& cancel);

// Without a clipper, primitives are assumed to fill their boxes.
[[nodiscard]] Bvh2 build_spatial(std::span<const PrimRef> prims, const BuildConfig& config, const PrimClipper* clipper,
                                 ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
