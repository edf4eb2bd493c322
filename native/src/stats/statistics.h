// The cost of tracing a ray.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace perfect_bvh {

struct RayCounts {
  std::uint32_t nodes_visited = 0;  // of both levels; entering an instance counts as one
  std::uint32_t primitives_tested = 0;
};

// Scene statistics ----------------------------------------------------------------------------------------------------
// Sizes and quality of a committed scene.

struct TreeStatistics {
  std::int32_t mesh_id = -1;  // -1 for the top level
  std::string builder;        // as in BuildConfig; for the top level see TopLevelReport
  std::string kind;           // "triangles", "curves" or "points"; "instances" for the top level
  std::size_t primitive_count = 0;
  std::size_t vertex_count = 0;    // for curves and points, their spheres
  std::size_t left_out_count = 0;  // points and curves' segments without a radius
  std::size_t user_count = 0;      // instances

  // The binary tree, which is no longer kept. If the tree was never binary, and for the top level, the wide tree, with
  // its leaf blocks or instances as leaves. Details exist only for binary trees.
  bool is_refittable = true;
  std::size_t node_count = 0;
  std::size_t leaf_count = 0;
  std::size_t reference_count = 0;
  std::uint32_t max_leaf_size = 0;
  std::uint32_t depth = 0;
  double sah = 0;
  double sibling_overlap = 0;
  std::optional<double> epo, leaf_count_variability;  // only on request

  // The tree that rays are traced through.
  std::size_t wide_node_count = 0;
  std::size_t wide_leaf_count = 0;
  std::uint32_t wide_depth = 0;

  std::size_t geometry_byte_count = 0;  // positions and triangles, or spheres; the instances for the top level
  std::size_t wide_byte_count = 0;
  std::size_t plan_byte_count = 0;  // of the refit data; 0 before the first refit
  // For motion within the shutter: positions and trees of the steps after the first. For the top level: its trees at
  // the times of the shutter, and the instances' placement at their own steps.
  std::size_t motion_byte_count = 0;
  std::size_t byte_count = 0;  // the sum of the four
};

// By their kinds.
struct PrimitiveCounts {
  std::size_t triangles = 0, segments = 0, points = 0;
};

struct SceneStatistics {
  std::vector<TreeStatistics> meshes;
  TreeStatistics top_level;
  PrimitiveCounts distinct;   // each mesh once
  PrimitiveCounts instanced;  // as rays see them
  std::size_t instance_count = 0;
  std::size_t byte_count = 0;
  std::uint64_t generation = 0;
};

// Commit report -------------------------------------------------------------------------------------------------------
// The actions of a commit, and their reasons.

enum class MeshAction : std::uint8_t {
  kKept,
  kBuilt,
  kRefitted,       // new boxes for the same tree
  kRotated,        // refitted, then restructured by rotations
  kPartlyRebuilt,  // refitted, then rebuilt in the parts degraded by motion
  kRebuilt,
};

// A possible action for a mesh, and its expected cost on one thread.
struct AlternativeReport {
  MeshAction action = MeshAction::kKept;
  std::string builder;  // empty if nothing would be built
  double update_milliseconds = 0;
  std::optional<double> trace_milliseconds;  // of the expected rays; empty if these are unknown
};

struct MeshReport {
  std::int32_t mesh_id = -1;
  std::string usage;  // the owner's expectation
  MeshAction action = MeshAction::kKept;
  std::string reason;
  // The inputs of the decision.
  std::vector<AlternativeReport> alternatives;  // empty if there was no choice
  std::optional<double> expected_rays;          // for the mesh; empty if unknown
  double node_visits = 0, leaf_visits = 0;      // expected for such a ray in the tree that is traced now
  std::string builder;                          // of the tree, now or before a refit, or of the next tree
  double milliseconds = 0;                      // of all stages; the following are 0 for stages that did not run
  double build_milliseconds = 0;
  double optimize_milliseconds = 0;
  double refit_milliseconds = 0;        // even if the refitted tree was rejected
  double restructure_milliseconds = 0;  // of rotations and of rebuilding parts
  double restructured_share = 0;        // the share of the tree's leaves in parts that were rebuilt
  double collapse_milliseconds = 0;
  // The expected cost of a ray that hits the mesh's box, in visits to nodes: in the tree when it was built, in that
  // tree refitted (both 0 if no refit was tried), and in the present tree.
  double fresh_cost = 0, refitted_cost = 0, cost = 0;
  std::string kind;                // "triangles", "curves" or "points"
  std::size_t triangle_count = 0;  // of curves, their segments; or points
  std::size_t byte_count = 0;
};

// Milliseconds by the wall clock; 0 if a stage did not run.
struct TopLevelReport {
  bool is_refitted = false;
  std::string reason;               // why it was kept, refitted or built
  std::string builder;              // "agglomerative" if clustering paid off, else that of the tree below; "" if empty
  double placing_milliseconds = 0;  // inverse transforms and world boxes
  double refit_milliseconds = 0;    // of both trees, even if they were rejected
  double build_milliseconds = 0;    // the binary tree
  double clustering_milliseconds = 0;  // of its upper part
  double collapse_milliseconds = 0;    // the wide tree
};

struct CommitReport {
  std::vector<MeshReport> meshes;   // those that were not kept, by ascending id
  std::vector<MeshReport> resting;  // those that were kept although motion had degraded their trees, and the reasons
  std::size_t kept_count = 0;
  std::size_t instance_count = 0;
  std::size_t baked_count = 0;  // instances without a usable inverse, traced as world-space copies
  double mesh_milliseconds = 0;
  double top_level_milliseconds = 0;
  TopLevelReport top_level;
  double milliseconds = 0;
  std::size_t byte_count = 0;
  std::uint64_t generation = 0;
};

}  // namespace perfect_bvh
