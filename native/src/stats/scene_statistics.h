// Sizes and quality of a committed scene.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace perfect_bvh {

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

}  // namespace perfect_bvh
