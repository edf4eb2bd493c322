// Builds a part of a tree anew and keeps the rest: for a tree that motion has spoilt in one place only.
// In: a tree, a node of it, its primitives' boxes, a builder's settings. Out: the tree with that part exchanged.
#pragma once

#include <span>

#include "build/builder.h"

namespace perfect_bvh {

// Rebuilds what lies below `node`. `prim_boxes` are by primitive number and are read only for the primitives of that
// part; the boxes of the nodes above it are made to fit. Nodes outside keep their boxes and their primitives, though
// not their places. False, and the tree unchanged, if the new part would make it deeper than kMaxTreeDepth. Throws
// InvalidArgument if the tree is not refittable (a part's boxes are then not those of its primitives) or `node` is no
// node of it, and what build_bvh2 throws; the tree is then unchanged.
[[nodiscard]] bool rebuild_below(Bvh2& tree, std::uint32_t node, std::span<const Aabb> prim_boxes,
                                 const BuildConfig& config, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
