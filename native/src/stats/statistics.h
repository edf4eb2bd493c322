// What tracing a ray cost.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace perfect_bvh {

struct RayCounts {
  std::uint32_t nodes_visited = 0;  // of both levels; an instance that is entered counts as one
  std::uint32_t primitives_tested = 0;
};

// Scene statistics ----------------------------------------------------------------------------------------------------
// Sizes and quality of a committed scene.

struct TreeStatistics {
  std::int32_t mesh_id = -1;  // -1 for the top level
  std::string builder;        // as in BuildConfig; of the top level see TopLevelReport
  std::string kind;           // "triangles", "curves" or "points"; of the top level "instances"
  std::size_t primitive_count = 0;
  std::size_t vertex_count = 0;    // of curves and points their balls
  std::size_t left_out_count = 0;  // of points and curves' segments: those without a radius
  std::size_t user_count = 0;      // instances

  // The binary tree, whether or not it is still kept; of a tree that was never binary the wide one, with its leaf
  // blocks for leaves. Details are of binary trees alone.
  bool is_refittable = true;
  std::size_t node_count = 0;
  std::size_t leaf_count = 0;
  std::size_t reference_count = 0;
  std::uint32_t max_leaf_size = 0;
  std::uint32_t depth = 0;
  double sah = 0;
  double sibling_overlap = 0;
  std::optional<double> epo, leaf_count_variability;  // only where asked for

  // The tree that rays are traced through.
  std::size_t wide_node_count = 0;
  std::size_t wide_leaf_count = 0;
  std::uint32_t wide_depth = 0;

  std::size_t geometry_byte_count = 0;  // positions and triangles, or balls; of the top level the instances
  std::size_t binary_byte_count = 0;    // 0 where the binary tree is no longer kept
  std::size_t wide_byte_count = 0;
  std::size_t plan_byte_count = 0;  // of what refits go by; 0 before the first one
  // Of what moves within the shutter: the steps after the first, positions and trees; of the top level its trees at the
  // times of the shutter, and where instances are at their own steps.
  std::size_t motion_byte_count = 0;
  std::size_t byte_count = 0;  // of the five together
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
// What a commit did, and why.

enum class MeshAction : std::uint8_t {
  kKept,
  kBuilt,
  kRefitted,       // new boxes, the same tree
  kRotated,        // refitted, then restructured by rotations
  kPartlyRebuilt,  // refitted, then rebuilt where motion had degraded it
  kRebuilt,
};

// What could have been done about a mesh, and what that was expected to cost on one thread.
struct AlternativeReport {
  MeshAction action = MeshAction::kKept;
  std::string builder;  // empty where nothing would be built
  double update_milliseconds = 0;
  std::optional<double> trace_milliseconds;  // of the expected rays; unknown without
};

struct MeshReport {
  std::int32_t mesh_id = -1;
  std::string usage;  // the class: what the owner expects
  MeshAction action = MeshAction::kKept;
  std::string reason;
  // The ledger: what the decision was made of.
  std::vector<AlternativeReport> alternatives;  // empty where there was no choice
  std::optional<double> expected_rays;          // of the mesh; unknown unless told
  double node_visits = 0, leaf_visits = 0;      // expected of such a ray in the tree that is traced now
  std::string builder;                          // that made the tree, now or before a refit; or will make it
  double milliseconds = 0;                      // of all stages; those that follow are 0 where a stage did not run
  double build_milliseconds = 0;
  double optimize_milliseconds = 0;
  double refit_milliseconds = 0;        // also where the refitted tree was then rejected
  double restructure_milliseconds = 0;  // of rotations and of rebuilding parts
  double restructured_share = 0;        // of the tree's leaves: those in parts that were rebuilt
  double collapse_milliseconds = 0;
  // Of a ray that meets the mesh's box, expected, in visits to nodes: of the tree when it was built, of that tree
  // refitted (both 0 where no refit was tried), and of what the mesh has now.
  double fresh_cost = 0, refitted_cost = 0, cost = 0;
  std::string kind;                // "triangles", "curves" or "points"
  std::size_t triangle_count = 0;  // of curves, their segments; or points
  std::size_t byte_count = 0;
};

// Milliseconds by the wall clock; 0 where a stage did not run.
struct TopLevelReport {
  bool is_refitted = false;
  std::string reason;   // why it was kept, refitted or built
  std::string builder;  // "agglomerative" where clustering paid, else that of the tree below; "" over nothing
  double placing_milliseconds = 0;     // inverse transforms and world boxes
  double refit_milliseconds = 0;       // of both trees; also where they were then rejected
  double build_milliseconds = 0;       // the binary tree
  double clustering_milliseconds = 0;  // of its upper part
  double collapse_milliseconds = 0;    // the wide tree
};

struct CommitReport {
  std::vector<MeshReport> meshes;   // those that were not kept, in the order of their ids
  std::vector<MeshReport> resting;  // those that were kept although motion had degraded their trees, and why
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
