// A few boxes that cover a mesh: the top of its tree. Turned into world space one by one they bound an instance far
// more tightly than its turned root box, and what limits instanced rays is how many instances a ray enters.
#pragma once

#include <vector>

#include "build/bvh2.h"

namespace perfect_bvh {

// At most `limit` boxes that hold every primitive of the tree; empty for an empty tree.
[[nodiscard]] std::vector<Aabb> cover_boxes(const Bvh2& tree, std::size_t limit);

}  // namespace perfect_bvh
