// What a commit did, and why.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace perfect_bvh {

enum class MeshAction : std::uint8_t { kKept, kBuilt, kRefitted, kRebuilt };

struct MeshReport {
  std::int32_t mesh_id = -1;
  MeshAction action = MeshAction::kKept;
  std::string reason;
  std::string builder;      // that made the tree, now or before a refit
  double milliseconds = 0;  // of all stages; those that follow are 0 where a stage did not run
  double build_milliseconds = 0;
  double optimize_milliseconds = 0;
  double refit_milliseconds = 0;  // also where the refitted tree was then rejected
  double collapse_milliseconds = 0;
  std::size_t triangle_count = 0;
  std::size_t byte_count = 0;
};

struct CommitReport {
  std::vector<MeshReport> meshes;  // those that were not kept, in the order of their ids
  std::size_t kept_count = 0;
  std::size_t instance_count = 0;
  std::size_t baked_count = 0;  // instances without a usable inverse, traced as world-space copies
  double mesh_milliseconds = 0;
  double top_level_milliseconds = 0;
  double milliseconds = 0;
  std::size_t byte_count = 0;
  std::uint64_t generation = 0;
};

}  // namespace perfect_bvh
