// The boxes of one tree, to be looked at: columns of equal length, from the root downwards, a level after the other.
#pragma once

#include <cstdint>
#include <vector>

namespace perfect_bvh {

struct TreeBoxes {
  std::vector<double> corners;           // six a box: lower x, y, z, upper x, y, z
  std::vector<std::int32_t> levels;      // 0 for the root
  std::vector<std::int32_t> leaf_sizes;  // triangles of a leaf, 1 for an instance, 0 for an interior node
  std::vector<float> costs;              // its share of the surface area heuristic's cost
  std::vector<float> overlaps;           // area shared with its siblings, as a share of its own
  std::uint32_t depth = 0;               // the deepest level of the whole tree
  [[nodiscard]] std::size_t count() const noexcept { return levels.size(); }
};

}  // namespace perfect_bvh
