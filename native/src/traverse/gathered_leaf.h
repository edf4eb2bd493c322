// A leaf of the compact layout as it is tested: its triangles' corners, read from the mesh and brought to the tree's
// scale. They are the floats that a LeafBlock would hold, and what is made of them are the same bits.
#pragma once

#include <cstdint>

namespace perfect_bvh {

struct alignas(32) GatheredLeaf {
  float corners[3][3][8];  // first, second, third corner; x, y, z; of the eight triangles
  std::uint32_t primitives[8];
};

// A leaf of curves or points: each one's two balls (a point's are the same), as x, y, z and radius in the tree's scale.
struct alignas(32) GatheredBalls {
  float first[4][8], last[4][8];
};

}  // namespace perfect_bvh
