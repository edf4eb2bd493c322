// What the governor knows of a mesh's shape, from a sample of its triangles.
#pragma once

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "mesh/mesh.h"

namespace perfect_bvh {

// How well triangles can be told apart by a tree, from a sample of them: what a fresh tree over all of them costs
// changes as that of one over every so-many-th triangle does.
// In: a mesh. Out: the cost (SAH) of the sample's tree, to be compared with that of the same mesh in another shape.
//
// Against trees that were built, the logarithm of the change was off by .03 (a tree in the wind) and .02 (cloth) in the
// mean square, by .16 and .18 for meshes twisted by up to 25 radians and sheared up to a hundredfold, whose trees at
// rest say nothing, and by .36 for a ball that bursts into all its triangles.
//
// 0 for a mesh whose box has no area. A sixteenth of the triangles, but from 64 to 1024 of them: a third of a
// millisecond. The same number for any number of threads. Throws bad_alloc.
[[nodiscard]] double measure_tree_sample(const Mesh& mesh, ThreadPool& pool);

// How much air there is in the boxes of a mesh's triangles: what cutting them, as spatial splits do, can take away.
// In: a mesh. Out: the area of those boxes, less three times that of their triangles, over the area of the mesh's box,
// from every so-many-th triangle. A triangle that is no thinner than a half square has a box of no more than that. Of
// curves and points the same, with the boxes of their segments, as they lie, for the triangles' areas.
// 0 for a mesh whose box has no area. Looks at some thousand triangles and at every vertex.
[[nodiscard]] double measure_air(const Mesh& mesh, CancelToken& cancel);

}  // namespace perfect_bvh
