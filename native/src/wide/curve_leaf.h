// Leaves over curves: each segment's capsule in whole steps, eight side by side.
#pragma once

#include <cstdint>

#include "mesh/mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// From 1 to 8 different segments, in any order. Balls are taken times `scale`.
[[nodiscard]] CurveLeaf make_curve_leaf(const std::uint32_t* primitives, std::uint32_t count, const Mesh& mesh,
                                        float scale) noexcept;

// Where the segments of a leaf whose primitives are known are now.
void write_axes(CurveLeaf& leaf, const Mesh& mesh, float scale) noexcept;

}  // namespace perfect_bvh
