// A few boxes that cover a mesh: the top of its tree. Turned into world space one by one they bound an instance far
// more tightly than its turned root box, and what limits instanced rays is how many instances a ray enters.
#pragma once

#include <cstddef>
#include <vector>

#include "build/bvh2.h"
#include "core/aligned.h"
#include "math/affine.h"

namespace perfect_bvh {

// Four boxes, so that they are turned at once.
struct alignas(16) CoverGroup {
  float centre[3][4];
  float half[3][4];  // half the sides, rounded up
};

struct Cover {
  AlignedVector<CoverGroup> groups;  // places to spare repeat the first box; empty over an empty mesh
  double reach = 0;                  // the largest magnitude of a coordinate
};

// Past some dozens of boxes the bounds hardly tighten.
inline constexpr std::size_t kCoverBoxes = 32;

// At most `limit` boxes that hold every primitive of the tree; empty for an empty tree.
[[nodiscard]] std::vector<Aabb> cover_boxes(const Bvh2& tree, std::size_t limit);
[[nodiscard]] Cover make_cover(const Bvh2& tree, std::size_t limit = kCoverBoxes);

// The world box of what is covered, rounded outward and with a margin: every hit in the mesh lies inside it.
[[nodiscard]] Aabb transformed_bounds(const Cover& cover, const Affine& map);

}  // namespace perfect_bvh
