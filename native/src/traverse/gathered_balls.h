// Balls of a leaf of curves or points as they are tested: read from the mesh and brought to the tree's scale.
#pragma once

namespace perfect_bvh {

// Each primitive's two balls (a point's are the same), as x, y, z and radius in the tree's scale.
struct alignas(32) GatheredBalls {
  float first[4][8], last[4][8];
};

}  // namespace perfect_bvh
