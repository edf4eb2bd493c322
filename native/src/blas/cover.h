// A few boxes that cover a mesh: the top of its tree. Turned into world space one by one they bound an instance far
// more tightly than its turned root box, and what limits instanced rays is how many instances a ray enters.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "builders/bvh2.h"
#include "core/aligned.h"
#include "math/affine.h"
#include "mesh/triangle_mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Four boxes, so that they are turned at once.
struct alignas(16) CoverGroup {
  float centre[3][4];
  float half[3][4];  // half the sides, rounded up
};

struct Cover {
  AlignedVector<CoverGroup> groups;  // places to spare repeat the first box; empty over an empty mesh
  double reach = 0;                  // the largest magnitude of a coordinate
  Aabb box;                          // around all of them: that of the triangles, whatever the tree
};

// Past some dozens of boxes the bounds hardly tighten.
inline constexpr std::size_t kCoverBoxes = 32;

// At most `limit` boxes that hold every primitive of the tree; empty for an empty tree.
[[nodiscard]] std::vector<Aabb> cover_boxes(const Bvh2& tree, std::size_t limit);
[[nodiscard]] std::vector<Aabb> cover_boxes(const WideBvh& tree, const TriangleMesh& mesh, std::size_t limit);
// Of a mesh without a tree: boxes around runs of consecutive triangles, which mostly lie near each other.
[[nodiscard]] std::vector<Aabb> cover_boxes(const TriangleMesh& mesh, std::size_t limit);
[[nodiscard]] Cover make_cover(const std::vector<Aabb>& boxes);
[[nodiscard]] inline Cover make_cover(const Bvh2& tree, std::size_t limit = kCoverBoxes) {
  return make_cover(cover_boxes(tree, limit));
}

// One axis of a world box, about `place`, rounded outward and with a margin. Tracing moves a hit by less than
// 100 * 2^-24 of the mesh's reach on each of its axes (math/slab.h, with |origin| <= 4 reach and the narrowing of the
// ray); the inverse may be off by as much as place_instance() accepts; bounds computed in float are rounded some 20
// times. 2^-16 covers all of it, and 2^-140 what is lost below the smallest floats.
inline void set_range(Aabb& box, int axis, double place, double least, double greatest, double reach, Vec3d row) {
  const double margin = 0x1p-16 * reach * (std::abs(row.x) + std::abs(row.y) + std::abs(row.z));
  const double lower = place + (least - margin), upper = place + (greatest + margin);
  // Half a unit of float is added whichever way the narrowing goes.
  box.lower[axis] = static_cast<float>(lower - (0x1p-23 * std::abs(lower) + 0x1p-140));
  box.upper[axis] = static_cast<float>(upper + (0x1p-23 * std::abs(upper) + 0x1p-140));
}

// The world box of what is covered, rounded outward and with a margin: every hit in the mesh lies inside it.
[[nodiscard]] Aabb transformed_bounds(const Cover& cover, const Affine& map);

// The world box of a box, to the nearest float; empty for an empty one.
[[nodiscard]] Aabb transformed_box(const Aabb& box, const Affine& map);

}  // namespace perfect_bvh
