// The cost of work on this machine, in nanoseconds of one thread, as used by the governor.
// In: numbers that were measured once (perfect_bvh.calibration in Python). Plain data, so that decisions are
// reproducible.
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

// Build costs are those of a mesh of this many triangles; the time per triangle of larger ones grows with their
// logarithm.
inline constexpr double kCalibratedTriangles = 65536;

struct BuilderCost {
  double build_nanoseconds = 0;  // per triangle, from the mesh to the traced tree
  double trace_nanoseconds = 0;  // per ray that hits the mesh's box
};

// Without a measurement, updates are free, and a node costs as much as a leaf.
struct Calibration {
  double node_nanoseconds = 1;           // of visiting a wide node ...
  double leaf_nanoseconds = 1;           // ... and a leaf block of up to 8 triangles
  double refit_nanoseconds = 0;          // per triangle
  double rotate_nanoseconds = 0;         // per triangle, in addition to the refit
  double rebuild_parts_nanoseconds = 0;  // per triangle in the parts, beyond two refits
  double rotation_gain = 0.5;            // the gain of rotations, as a share of the gain of new parts
  BuilderCost fast, binned, spatial;

  [[nodiscard]] const BuilderCost& of(BuilderKind kind) const noexcept {
    switch (kind) {
      case BuilderKind::kFast:
        return fast;
      case BuilderKind::kSpatial:
        return spatial;
      default:  // the others are for comparisons, and never chosen for speed
        return binned;
    }
  }
};

// Governor ------------------------------------------------------------------------------------------------------------
// Decides how to update a tree whose triangles moved (lecture, "Refitting": where it is unsuitable), and which builder
// makes a tree. A moved tree may be refitted, restructured by rotations or by rebuilding parts of it, or be replaced.
// In: the cost of a ray in the refitted tree and in the tree when it was built, the expected number of rays, the cost
// paid since, the machine's calibration. Out: the action, its reason, and the expected cost of each alternative. Pure
// functions without a clock or a thread count, so that decisions are reproducible.
//
// A refitted tree gets worse from frame to frame. The excess e(k) of the k-th frame after a build is the cost of its
// rays beyond those in a fresh tree. Rebuilding every k frames costs (rebuild + e(1) + ... + e(k-1)) / k per frame,
// which is least where e(k) begins to exceed that mean: the rule of Silver and Meal 1973 for lot sizes, which needs no
// forecast. Restructuring is decided in the same way, by the excess that it would remove.
//
// The cost of a fresh tree is unknown before it is built. So a tree is built over a sample of the triangles
// (mesh_shape.h). Its change predicts the change of the whole tree's cost, as sample^exponent, and each rebuild
// measures the exponent of this mesh. The cost of restructuring depends on the share of the tree that it would rebuild.

// All except the first are for comparisons; they always do the same action if it is possible.
enum class Policy : std::uint8_t { kGoverned, kRefit, kRotate, kRebuildParts, kRebuild };

// kKeep: only for triangles that did not move.
enum class UpdateAction : std::uint8_t { kRefit, kRotate, kRebuildParts, kRebuild, kKeep };

// The additional cost of rays, compared with taking an action in each commit.
struct Excess {
  double nanoseconds = 0;
  std::uint32_t commit_count = 0;
};

// The data of a tree that is kept from commit to commit.
struct UpdateHistory {
  TraceWork fresh;                 // in the tree when it was built ...
  double sample = 0;               // ... and in one over a sample then, see measure_tree_sample; 0 if unknown
  std::optional<double> exponent;  // of the sample, in the cost of a fresh tree; unknown before the first rebuild
  Excess since_build;              // compared with a fresh tree
  Excess since_restructuring;      // compared with a restructured tree
  TraceWork restructured;          // in the tree when it was restructured last, if it was since its build
  Excess at_rest;                  // compared with a fresh tree, since the triangles moved last
  TraceWork now;                   // in the traced tree ...
  double sample_now = 0;           // ... and in one over the present sample
};

struct UpdateQuestion {
  Policy policy = Policy::kGoverned;
  std::size_t triangle_count = 0;
  BuilderKind builder = BuilderKind::kBinned;  // of a new tree
  std::optional<double> rays;                  // expected to hit the mesh's box; unknown: the tree's decay decides
  TraceWork now;                               // in the refitted tree
  TraceWork reference;                         // in the tree when it was built or restructured last
  double sample = 0;                           // of the present mesh; 0 if unknown
  double degraded_share = 1;                   // share of the tree in its degraded parts
  UpdateHistory history;
};

struct Alternative {
  UpdateAction action;
  BuilderKind builder;  // of the new or held tree; kAuto if there is none
  double update_nanoseconds;
  std::optional<double> trace_nanoseconds;  // empty if the rays are unknown
};

struct UpdateDecision {
  UpdateAction action = UpdateAction::kRefit;
  std::string reason;
  std::vector<Alternative> alternatives;
  UpdateHistory history;  // if the tree stays; a new tree gets a new one
};

[[nodiscard]] UpdateDecision decide_update(const UpdateQuestion& question, const Calibration& calibration);

// Limits if the number of rays is unknown: the factor by which a ray's cost may exceed that in the tree when it was
// built (or restructured). Up to the first, the refitted tree stays; up to the second, rotations are enough; up to the
// third, the tree stays after its degraded parts were rebuilt.
inline constexpr double kRefitLimit = 1.05, kRotateLimit = 1.2, kRestructureLimit = 1.3;

// Return whether it is worth measuring the cost of a fresh tree (the sample), or the degraded share of the tree. It is
// not if even the best possible result would not change the decision.
[[nodiscard]] bool may_rebuild(const UpdateQuestion& question, const Calibration& calibration) noexcept;
[[nodiscard]] bool may_restructure(const UpdateQuestion& question, const Calibration& calibration) noexcept;

// Returns whether a restructured tree is good enough to stay.
[[nodiscard]] bool is_restructured(const UpdateQuestion& question, const TraceWork& restructured) noexcept;

// Begins the history of a tree that was just built. `last`: that of the previous tree over the same triangles, or an
// empty one.
[[nodiscard]] UpdateHistory begin_history(const UpdateHistory& last, const TraceWork& fresh, double sample,
                                          const Calibration& calibration) noexcept;

// Returns the expected cost of a ray in a tree that would be built now.
[[nodiscard]] double fresh_nanoseconds(const UpdateHistory& history, double sample,
                                       const Calibration& calibration) noexcept;
[[nodiscard]] double ray_nanoseconds(const TraceWork& work, const Calibration& calibration) noexcept;
[[nodiscard]] double build_nanoseconds(std::size_t triangle_count, BuilderKind builder,
                                       const Calibration& calibration) noexcept;

struct BuildQuestion {
  std::span<const BuilderKind> builders;  // the possible ones, at least one
  std::size_t triangle_count = 0;
  double rays = 0;                                 // expected to hit the mesh's box
  double air = 0;                                  // empty-space ratio of the mesh, see measure_air()
  std::optional<BuilderKind> held = std::nullopt;  // its tree exists and costs nothing more
};

struct BuildDecision {
  BuilderKind builder;
  std::vector<Alternative> alternatives;
};

// Returns the builder with the least expected total of build time and ray cost. Spatial splits are only expected to
// gain on meshes whose triangles' boxes are largely empty.
[[nodiscard]] BuildDecision decide_build(const BuildQuestion& question, const Calibration& calibration);

// Returns the number of rays beyond which another builder's tree pays off; infinity if none is better than the held
// one.
[[nodiscard]] double repaying_rays(const BuildQuestion& question, const Calibration& calibration) noexcept;

// Wording -------------------------------------------------------------------------------------------------------------
// Formats decisions as text.

// "1.3"; huge values are clamped.
[[nodiscard]] inline std::string with_tenths(double value) {
  const auto tenths = static_cast<long long>(std::clamp(value, 0.0, 1e12) * 10.0 + 0.5);
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10);
}

// Two digits, and all digits before the point: "121", "12", "1.2", "0.12".
[[nodiscard]] inline std::string with_two_digits(double value) {
  if (value >= 9.95) return std::to_string(static_cast<long long>(std::min(value, 1e12) + 0.5));
  if (value >= 0.995) return with_tenths(value);
  const auto hundredths = static_cast<int>(std::max(value, 0.0) * 100.0 + 0.5);
  return "0." + std::to_string(hundredths / 10) + std::to_string(hundredths % 10);
}

// Returns whether the value rounds to zero hundredths of a millisecond.
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
// Decides whether to keep a tree that motion degraded and whose triangles no longer move.
// In: the tree's history, the expected rays of this commit, the machine's calibration.
// Out: whether the tree is kept or rebuilt, the reason, and the expected cost of both. Pure functions.
//
// It is unknown how long the triangles will rest. Each commit in the degraded tree costs its rays more than a fresh
// tree would: a rent. A new tree is the purchase that ends it. Buying when the rents paid equal the price costs at most
// twice as much as the best choice in hindsight (the ski rental problem; Karlin, Manasse, Rudolph and Sleator 1988,
// "Competitive snoopy caching").

struct RestQuestion {
  std::size_t triangle_count = 0;
  const char* what = "triangles";              // the mesh's primitives, as named in sentences
  BuilderKind builder = BuilderKind::kBinned;  // of a new tree
  std::optional<double> rays;                  // expected to hit the mesh's box now; unknown: the tree is kept
  UpdateHistory history;
};

// Returns whether rays are expected to be slower in a refitted tree than in a new one.
[[nodiscard]] bool is_degraded(const UpdateHistory& history, const Calibration& calibration) noexcept;

// Decides for triangles that did not move in this commit: kKeep or kRebuild.
[[nodiscard]] UpdateDecision decide_at_rest(const RestQuestion& question, const Calibration& calibration);

}  // namespace perfect_bvh
