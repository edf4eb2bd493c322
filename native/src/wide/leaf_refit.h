// The leaves of a wide tree, moved to where their triangles are now.
#pragma once

#include <cstdint>
#include <span>

#include "math/float4.h"
#include "mesh/mesh.h"
#include "wide/refit_plan.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Writes to `to` what the leaves in these rows of `from` (it may be the same tree) become over the mesh's positions, in
// the scale of `to`, and to `boxes` the box of each: with positive zeros, and fourth lanes that mean nothing.
// `vertices` are those of `from`.
void refit_leaves(const WideBvh& from, const LeafVertices& vertices, const Mesh& mesh,
                  std::span<const std::uint32_t> rows, WideBvh& to, Box4* boxes) noexcept;

}  // namespace perfect_bvh
