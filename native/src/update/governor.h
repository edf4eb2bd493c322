// What work costs on this machine, in nanoseconds of one thread: what the governor reckons with.
// In: numbers that were measured once (perfect_bvh.calibration in Python). Plain data, so that decisions repeat.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "builders/builder.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {

// Building costs are those of a mesh of this many triangles; the time of larger ones grows by their logarithm, too.
inline constexpr double kCalibratedTriangles = 65536;

struct BuilderCost {
  double build_nanoseconds = 0;  // a triangle, from the mesh to what rays are traced through
  double trace_nanoseconds = 0;  // a ray that meets the mesh's box
};

// Without a measurement updates are free, and a node costs what a leaf does.
struct Calibration {
  double node_nanoseconds = 1;           // of visiting a wide node ...
  double leaf_nanoseconds = 1;           // ... and a leaf block of up to 8 triangles
  double refit_nanoseconds = 0;          // a triangle
  double rotate_nanoseconds = 0;         // a triangle, beyond the refit
  double rebuild_parts_nanoseconds = 0;  // a triangle in the parts, beyond the refit and as much for putting them in
  double rotation_gain = 0.5;            // the share of what new parts gain that rotations do
  BuilderCost fast, binned, spatial;

  [[nodiscard]] const BuilderCost& of(BuilderKind kind) const noexcept {
    switch (kind) {
      case BuilderKind::kFast:
        return fast;
      case BuilderKind::kSpatial:
        return spatial;
      default:  // the others are for comparisons and are not chosen for speed
        return binned;
    }
  }
};

// Governor ------------------------------------------------------------------------------------------------------------
// Decides what becomes of a tree whose triangles moved (lecture, "Refitting": where it is unsuitable), and what builds
// a tree. A moved tree may be refitted, restructured by rotations or by building parts of it again, or be replaced. In:
// what a ray costs in the tree as refitted and as it was built, how many rays are expected, what was paid since, the
// machine's calibration. Out: the action, its reason, and what each alternative was expected to cost. Pure functions:
// no clock, no thread count, so that a decision repeats.
//
// A refitted tree grows worse from frame to frame. The excess e(k) of the k-th frame after a build is what its rays
// cost beyond a fresh tree's. To rebuild every k frames costs (rebuild + e(1) + ... + e(k-1)) / k a frame, which is
// least where e(k) comes to exceed that mean: the rule of Silver and Meal 1973 for lot sizes, which needs no forecast.
// Restructuring is weighed in the same way, by the excess that it would take away.
//
// What a fresh tree would cost is unknown before it is built. So one is built over a sample of the triangles
// (mesh_shape.h): how that changed tells how the cost of the whole did, as sample^exponent, and each rebuild tells the
// exponent of this mesh. Restructuring costs by the share of the tree that it would rebuild.

// All but the first are for comparisons: what can be done so always is.
enum class Policy : std::uint8_t { kGoverned, kRefit, kRotate, kRebuildParts, kRebuild };

// kKeep: of triangles that did not move.
enum class UpdateAction : std::uint8_t { kRefit, kRotate, kRebuildParts, kRebuild, kKeep };

// What rays have paid beyond what they would have, had something been done in each commit.
struct Excess {
  double nanoseconds = 0;
  std::uint32_t commit_count = 0;
};

// What is remembered of a tree from commit to commit.
struct UpdateHistory {
  TraceWork fresh;                 // of the tree when it was built ...
  double sample = 0;               // ... and of one over a sample then, see measure_tree_sample; 0 if unknown
  std::optional<double> exponent;  // of the sample, in what a fresh tree costs; unknown before the first rebuild
  Excess since_build;              // beyond a fresh tree
  Excess since_restructuring;      // beyond a restructured one
  TraceWork restructured;          // of the tree when it was restructured last, if it was since it was built
  Excess at_rest;                  // beyond a fresh tree, since the triangles moved last
  TraceWork now;                   // of the tree that is traced ...
  double sample_now = 0;           // ... and of one over the sample now
};

struct UpdateQuestion {
  Policy policy = Policy::kGoverned;
  std::size_t triangle_count = 0;
  BuilderKind builder = BuilderKind::kBinned;  // of a new tree
  std::optional<double> rays;                  // expected to meet the mesh's box; unknown: the tree's decay decides
  TraceWork now;                               // of the refitted tree
  TraceWork reference;                         // of the tree when it was built or restructured last
  double sample = 0;                           // of the mesh now; 0 if unknown
  double degraded_share = 1;                   // of the tree: what rebuilding its degraded parts would rebuild
  UpdateHistory history;
};

struct Alternative {
  UpdateAction action;
  BuilderKind builder;  // of the tree that would be built or is held; kAuto where none was weighed
  double update_nanoseconds;
  std::optional<double> trace_nanoseconds;  // unknown without expected rays
};

struct UpdateDecision {
  UpdateAction action = UpdateAction::kRefit;
  std::string reason;
  std::vector<Alternative> alternatives;
  UpdateHistory history;  // if the tree stays; a new one begins another
};

[[nodiscard]] UpdateDecision decide_update(const UpdateQuestion& question, const Calibration& calibration);

// Where the rays are unknown: by which factor a ray may cost more than when the tree was built (or than after
// restructuring) for the refitted tree to be left as it is; for rotations to be enough; and for the tree to stay after
// its degraded parts were rebuilt.
inline constexpr double kRefitLimit = 1.05, kRotateLimit = 1.2, kRestructureLimit = 1.3;

// Whether it is worth finding out what a fresh tree would cost (the sample), or which share of the tree is degraded.
// It is not where even the best possible outcome would leave the tree as it is.
[[nodiscard]] bool may_rebuild(const UpdateQuestion& question, const Calibration& calibration) noexcept;
[[nodiscard]] bool may_restructure(const UpdateQuestion& question, const Calibration& calibration) noexcept;

// Whether a tree that was restructured is good enough to stay.
[[nodiscard]] bool is_restructured(const UpdateQuestion& question, const TraceWork& restructured) noexcept;

// Of a tree that was just built; `last`: of the one before it over the same triangles, or an empty one.
[[nodiscard]] UpdateHistory begin_history(const UpdateHistory& last, const TraceWork& fresh, double sample,
                                          const Calibration& calibration) noexcept;

// What a ray is expected to cost in a tree that would be built now.
[[nodiscard]] double fresh_nanoseconds(const UpdateHistory& history, double sample,
                                       const Calibration& calibration) noexcept;
[[nodiscard]] double ray_nanoseconds(const TraceWork& work, const Calibration& calibration) noexcept;
[[nodiscard]] double build_nanoseconds(std::size_t triangle_count, BuilderKind builder,
                                       const Calibration& calibration) noexcept;

struct BuildQuestion {
  std::span<const BuilderKind> builders;  // that would do, at least one
  std::size_t triangle_count = 0;
  double rays = 0;                                 // expected to meet the mesh's box
  double air = 0;                                  // of the mesh, see measure_air()
  std::optional<BuilderKind> held = std::nullopt;  // whose tree is there and costs nothing more
};

struct BuildDecision {
  BuilderKind builder;
  std::vector<Alternative> alternatives;
};

// The builder whose time and rays are expected to cost least together. Spatial splits are expected to gain on meshes
// alone whose triangles' boxes hold much air.
[[nodiscard]] BuildDecision decide_build(const BuildQuestion& question, const Calibration& calibration);

// More rays than so many repay another builder's tree than the one that is held; infinity if none would be better.
[[nodiscard]] double repaying_rays(const BuildQuestion& question, const Calibration& calibration) noexcept;

// Wording -------------------------------------------------------------------------------------------------------------
// How decisions are put into words.

// "1.3"; what is beyond all measure is cut off.
[[nodiscard]] inline std::string with_tenths(double value) {
  const auto tenths = static_cast<long long>(std::clamp(value, 0.0, 1e12) * 10.0 + 0.5);
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10);
}

// Two digits, all that stand before the point: "121", "12", "1.2", "0.12".
[[nodiscard]] inline std::string with_two_digits(double value) {
  if (value >= 9.95) return std::to_string(static_cast<long long>(std::min(value, 1e12) + 0.5));
  if (value >= 0.995) return with_tenths(value);
  const auto hundredths = static_cast<int>(std::max(value, 0.0) * 100.0 + 0.5);
  return "0." + std::to_string(hundredths / 10) + std::to_string(hundredths % 10);
}

// What rounds to no hundredth of a millisecond.
[[nodiscard]] inline bool is_next_to_nothing(double nanoseconds) { return nanoseconds < 5e3; }

// "under 0.01 ms", "0.28 ms", "12 ms", "0.28 s" or "121 s".
[[nodiscard]] inline std::string as_time(double nanoseconds) {
  if (is_next_to_nothing(nanoseconds)) return "under 0.01 ms";
  if (nanoseconds < 99.5e6) return with_two_digits(nanoseconds * 1e-6) + " ms";
  return with_two_digits(nanoseconds * 1e-9) + " s";
}

[[nodiscard]] inline const char* verb_of(UpdateAction action) {
  constexpr std::array<const char*, 5> kVerbs{"refit", "rotate", "rebuild parts", "rebuild", "keep"};
  return kVerbs[static_cast<std::size_t>(action)];
}

// Rest ----------------------------------------------------------------------------------------------------------------
// Decides what becomes of a tree that motion degraded and whose triangles no longer move.
// In: what was remembered of the tree, how many rays are expected in this commit, the machine's calibration.
// Out: whether it is kept or rebuilt, why, and what either was expected to cost. Pure functions.
//
// How long the triangles will rest is unknown. Each commit in the degraded tree costs its rays more than a fresh tree
// would: a rent. A new tree is the purchase that ends it. Buying once the rents paid equal the price costs at most
// twice what the best choice in hindsight does (the ski rental problem; Karlin, Manasse, Rudolph and Sleator 1988,
// "Competitive snoopy caching").

struct RestQuestion {
  std::size_t triangle_count = 0;
  const char* what = "triangles";              // that the mesh is of, as sentences name it
  BuilderKind builder = BuilderKind::kBinned;  // of a new tree
  std::optional<double> rays;                  // expected to meet the mesh's box in this commit; unknown: it is kept
  UpdateHistory history;
};

// Whether rays are expected to lose anything in a tree that was refitted, beside a new one.
[[nodiscard]] bool is_degraded(const UpdateHistory& history, const Calibration& calibration) noexcept;

// Of triangles that did not move in this commit: kKeep or kRebuild.
[[nodiscard]] UpdateDecision decide_at_rest(const RestQuestion& question, const Calibration& calibration);

}  // namespace perfect_bvh
