// The world boxes of placed meshes: of one box or of the vertices turned into world space, and the margin of everything
// that bounds hits.
#pragma once

#include "math/aabb.h"
#include "math/affine.h"
#include "mesh/mesh.h"

namespace perfect_bvh {

// The largest magnitude of a coordinate in a box; 0 for an empty one.
[[nodiscard]] double reach_of(const Aabb& box) noexcept;

// Of a mesh's points p: no less than the greatest row . p, and no more than the least.
struct RowRange {
  double least, greatest;
};

// The world box of what lies along a map's rows in `ranges`, rounded outward and with a margin: every hit in the mesh
// lies inside it. `reach` is the largest magnitude of the mesh's coordinates. Tracing moves a hit by less than
// 100 * 2^-24 of it on each of its axes (math/slab.h, with |origin| <= 4 reach and the narrowing of the ray); the
// inverse may be off by as much as place_instance() accepts; bounds computed in float are rounded some 20 times. 2^-16
// covers all of it, and 2^-140 what is lost below the smallest floats.
[[nodiscard]] Aabb box_of_ranges(const RowRange (&ranges)[3], double reach, const Affine& map) noexcept;

// Of the box around a mesh, in the same way; empty for an empty one.
[[nodiscard]] Aabb transformed_bounds(const Aabb& box, const Affine& map) noexcept;
// Of the vertices or balls of a mesh: as close as can be. `box` is that around its primitives.
[[nodiscard]] Aabb transformed_bounds(const Mesh& mesh, const Aabb& box, const Affine& map) noexcept;

// The world box of a box, to the nearest float; empty for an empty one.
[[nodiscard]] Aabb transformed_box(const Aabb& box, const Affine& map) noexcept;

// Whether a map takes each axis to a multiple of an axis, so that no box is closer than the one around the mesh.
[[nodiscard]] bool keeps_axes(const Affine& map) noexcept;

}  // namespace perfect_bvh
