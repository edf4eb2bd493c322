// What a user may choose about a build. Defaults need no thought.
#pragma once

#include <cstdint>
#include <limits>

namespace perfect_bvh {

enum class BuilderKind : std::uint8_t { kAuto, kMedian, kSweep, kBinned, kSpatial, kFast };

struct BuilderName {
  BuilderKind kind;
  const char* name;  // as users write it
};

// All of them, in the order of BuilderKind.
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
  std::uint32_t bins = 16;            // binned, spatial: intervals an axis, 2 to 256; half of them to cut space at
  std::uint32_t axes = 3;             // binned: 3 tries all axes, 1 only the longest
  std::uint32_t max_leaf_size = 8;    // a leaf never holds more
  float traversal_cost = 1.0f;        // SAH: of visiting a node ...
  float intersection_cost = 1.0f;     // ... and of testing a primitive
  float duplication_budget = 0.3f;    // spatial: references added, as a share of the primitives
  std::uint32_t optimize_passes = 0;  // reinsertion passes after the build
  // No pass starts after so much time. With a limit the tree is another on a faster machine.
  double optimize_milliseconds = std::numeric_limits<double>::infinity();
  bool fills_leaves = false;  // binned: ends where primitives fit into one leaf of the wide tree

  friend bool operator==(const BuildConfig&, const BuildConfig&) = default;
};

}  // namespace perfect_bvh
