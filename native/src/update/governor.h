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
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "builders/build_config.h"
#include "update/calibration.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {

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

}  // namespace perfect_bvh
