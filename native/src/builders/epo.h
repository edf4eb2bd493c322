// End-point overlap: what a ray pays for nodes whose boxes hold a surface that is not in them (Aila, Karras and Laine
// 2013, "On quality metrics of bounding volume hierarchies", section 4). A ray ends on a surface; the nodes around that
// point are visited whether or not the surface is theirs. SAH does not see it, and trees of equal SAH differ by it.
// In: a tree and the triangles it was built over. Out: the expected cost of those visits, comparable with the SAH.
#pragma once

#include <cstdint>
#include <span>

#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/vec3.h"

namespace perfect_bvh {

// Sum over nodes of cost * (area of the triangles inside the node's box that are not below the node), divided by the
// area of all triangles; 0 if they have none. The same number for any thread count. About a microsecond for each node
// that a triangle meets: a figure to look at, not one to steer by. Counts triangles.size() units of work on `cancel`.
[[nodiscard]] double measure_epo(const Bvh2& tree, std::span<const Vec3f> positions,
                                 std::span<const Vec3<std::uint32_t>> triangles, ThreadPool& pool, CancelToken& cancel,
                                 float traversal_cost = 1.0f, float intersection_cost = 1.0f);

}  // namespace perfect_bvh
