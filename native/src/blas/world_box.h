// The world boxes of placed meshes, from one box or from the vertices turned into world space, and the margin of all
// boxes that bound hits.
#pragma once

#include <memory>
#include <mutex>

#include "math/aabb.h"
#include "mesh/mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Returns the largest magnitude of a coordinate in a box; 0 for an empty one.
[[nodiscard]] double reach_of(const Aabb& box) noexcept;

// The range of row . p over a mesh's points p: `greatest` is an upper bound, `least` a lower bound.
struct RowRange {
  double least, greatest;
};

// Returns the world box of points whose coordinates along a map's rows are in `ranges`, rounded outward and with a
// margin: every hit in the mesh is inside it. `reach` is the largest magnitude of the mesh's coordinates. Tracing moves
// a hit by less than 100 * 2^-24 of it on each of its axes (math/slab.h, with |origin| <= 4 reach and the narrowing of
// the ray). The inverse may be off by as much as place_instance() accepts. Bounds computed in float are rounded some 20
// times. 2^-16 covers all of these, and 2^-140 covers losses below the smallest floats.
[[nodiscard]] Aabb box_of_ranges(const RowRange (&ranges)[3], double reach, const Affine& map) noexcept;

// The same for the box around a mesh; empty for an empty one.
[[nodiscard]] Aabb transformed_bounds(const Aabb& box, const Affine& map) noexcept;
// The same for the vertices or spheres of a mesh, as tight as possible. `box` is the box of its primitives.
[[nodiscard]] Aabb transformed_bounds(const Mesh& mesh, const Aabb& box, const Affine& map) noexcept;

// Returns the world box of a box, to the nearest float; empty for an empty one.
[[nodiscard]] Aabb transformed_box(const Aabb& box, const Affine& map) noexcept;

// Returns whether a map takes each axis to a multiple of an axis. No box is then tighter than the one around the mesh.
[[nodiscard]] bool keeps_axes(const Affine& map) noexcept;

// Support -------------------------------------------------------------------------------------------------------------
// A table of how far a mesh reaches in any direction (its support function).
// In: the wide tree of a mesh. Out: bounds along the rows of a transform, in a few nanoseconds each, and within a
// percent of the tightest box, for any rotation of the instance.
// Nodes visited per ray, both levels, with 1,000 instances of a statue of 100,000 triangles, primary / diffuse rays:
//                            one box       8 boxes       32 boxes      this table    exact boxes
//   on a grid                9.4 / 22.2    8.4 / 20.2    8.3 / 20.1    7.8 / 19.3    7.8 / 19.3
//   in a heap                19.4 / 47.9   15.5 / 34.8   14.7 / 33.8   12.7 / 28.0   12.6 / 27.7
// The table takes 40 us to 1 ms to make, so it is not made for meshes with few vertices or instances
// (blas/world_box.h).
//
// The function is known exactly at samples on the faces of a cube. Between them it is bounded from above: where
// d = a u + b v with a, b >= 0, no point p has more than d.p = a u.p + b v.p.

class SupportTable {
 public:
  // The mesh's tree must not be empty.
  SupportTable(const WideBvh& tree, const Mesh& mesh);

  [[nodiscard]] RowRange along(Vec3d row) const noexcept;
  // Computes the ranges along the three rows of a map's linear part, equally tight. Returns false, and writes nothing,
  // if a row is extremely long or short.
  [[nodiscard]] bool along_ordinary_rows(const Affine& map, RowRange* ranges) const noexcept;

 private:
  static constexpr int kCells = 8;  // along a face's edge

  // For the direction with 1 on the face's axis, and for the opposite direction.
  struct Sample {
    float forward, backward;
  };
  Sample samples_[3][kCells + 1][kCells + 1];
  double unit_;  // from the tree's scale to the mesh's
};

// Returns the world box of a mesh, rounded outward and with a margin, as box_of_ranges() does. `reach` is the largest
// magnitude of the mesh's coordinates.
[[nodiscard]] Aabb transformed_bounds(const SupportTable& support, double reach, const Affine& map);

// A table that is made on first use, on any thread.
class LazySupport {
 public:
  [[nodiscard]] const SupportTable& of(const WideBvh& tree, const Mesh& mesh) const {
    std::call_once(made_, [&] { table_ = std::make_unique<const SupportTable>(tree, mesh); });
    return *table_;
  }

 private:
  mutable std::once_flag made_;
  mutable std::unique_ptr<const SupportTable> table_;
};

}  // namespace perfect_bvh
