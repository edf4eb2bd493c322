// Makes the tree that rays are traced through from a binary one.
// In: any Bvh2 (spatial splits too), and the triangles it stands over. Out: a WideBvh, the same bytes whatever machine
// made it.
#pragma once

#include <span>

#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

[[nodiscard]] WideBvh collapse_mesh(const Bvh2& tree, const Mesh& mesh, ThreadPool& pool, CancelToken& cancel);

// Over instances (their world boxes): leaves refer to one each.
[[nodiscard]] WideBvh collapse_top_level(const Bvh2& tree, ThreadPool& pool, CancelToken& cancel);

// Over two leaf blocks or more of a wide tree (their boxes as stored, numbered by row): the nodes above them, the root
// first.
[[nodiscard]] AlignedVector<WideNode> collapse_over_leaves(const Bvh2& tree, ThreadPool& pool, CancelToken& cancel);

}  // namespace perfect_bvh
