// Sizes and quality of a committed scene.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace perfect_bvh {

struct TreeStatistics {
  std::int32_t mesh_id = -1;  // -1 for the top level
  std::string builder;        // as in BuildConfig; of the top level "agglomerative"
  std::size_t primitive_count = 0;
  std::size_t vertex_count = 0;
  std::size_t node_count = 0;
  std::size_t leaf_count = 0;
  std::size_t reference_count = 0;
  std::uint32_t depth = 0;
  double sah = 0;
  std::size_t byte_count = 0;
  std::size_t user_count = 0;  // instances
};

struct SceneStatistics {
  std::vector<TreeStatistics> meshes;
  TreeStatistics top_level;
  std::size_t triangle_count = 0;            // of distinct meshes
  std::size_t instanced_triangle_count = 0;  // as rays see them
  std::size_t instance_count = 0;
  std::size_t byte_count = 0;
  std::uint64_t generation = 0;
};

}  // namespace perfect_bvh
